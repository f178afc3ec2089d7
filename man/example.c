/* A folder of CT slices becomes a picture, the one that `ctsplat render` makes: example FOLDER FILE.png
 * cc example.c -o example $(pkg-config --cflags --libs ctsplat) */
#include <ctsplat/ctsplat.h>
#include <stdio.h>

int main(int argc, char **argv)
{
    if (argc != 3) {
        fprintf(stderr, "example FOLDER FILE.png\n");
        return 2;
    }
    const CtsJobOption words[] = {
        {"path", argv[1], NULL},
        {"output", argv[2], NULL},
        {"force", "", NULL},
    };
    CtsError err;
    CtsReport report = {0};
    const CtsStatus status = cts_options_run(words, 3, NULL, NULL, &report, &err);
    for (size_t i = 0; i < report.diagnostics.n; i++)
        if (report.diagnostics.items[i].severity == CTS_WARNING)
            fprintf(stderr, "warning: %s\n", report.diagnostics.items[i].text);
    if (status)
        fprintf(stderr, "%s\n", err.text);
    cts_report_free(&report);
    return status != CTS_OK;
}
