/* ctsplat compare: how far two pictures are apart; exit 0 when equal to the bit, 1 when not. */
#include "cli/commands.h"
#include "cli/terminal.h"
#include <math.h>
#include <stdio.h>

static CtsStatus print_as_json(const CtsDifference *d, CtsError *err)
{
    /* JSON has no infinity, and a number must stay a number. */
    const double psnr_db = isfinite(d->psnr_db) ? d->psnr_db : 999;
    return cli_print_json(json_pack("{s:f,s:f,s:f,s:f,s:f,s:f,s:b}", "rmse", d->rmse, "psnr_db", psnr_db, "ssim",
                                    d->ssim, "p999", d->p999, "max", d->max, "share", d->share, "equal", d->equal),
                          err);
}

static void print_as_text(const CtsDifference *d)
{
    printf("rmse     %.6g\n", d->rmse);
    if (isfinite(d->psnr_db))
        printf("psnr     %.2f dB\n", d->psnr_db);
    else
        printf("psnr     infinite\n");
    printf("ssim     %.6f\n", d->ssim);
    printf("p99.9    %.6g\n", d->p999);
    printf("largest  %.6g\n", d->max);
    printf("share    %.6g of the pixels differ by more than 1/255\n", d->share);
    printf("%s\n", d->equal ? "equal to the bit" : "not equal");
}

CtsStatus cli_compare(const CtsOptions *options, int *exit_code, CtsError *err)
{
    CtsStatus st;
    CtsPicture *a = NULL, *b = NULL;
    CtsDifference difference;
    if ((st = cts_picture_read(options->paths.items[0], &a, err)) ||
        (st = cts_picture_read(options->paths.items[1], &b, err)))
        goto end;
    if ((st = cts_picture_compare(a, b, &difference, err))) {
        cts_context(err, "%s, %s", options->paths.items[0], options->paths.items[1]);
        goto end;
    }
    *exit_code = difference.equal ? 0 : 1;
    if (options->json)
        st = print_as_json(&difference, err);
    else
        print_as_text(&difference);
end:
    cts_picture_free(&a);
    cts_picture_free(&b);
    return st;
}
