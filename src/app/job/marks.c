#include "app/job/marks.h"

#include "base/mem.h"
#include "ctsplat/annotate.h"
#include "ctsplat/labels.h"

/* Draws names one below the other; adds those without room to *n_left_out. */
static CtsStatus draw_names(CtsPicture *band, const CtsLegendEntry *entries, size_t n, int *n_left_out,
                            CtsReport *report, CtsError *err)
{
    int n_in_part = 0, n_out = 0;
    const CtsStatus st = cts_annotate_legend(band, entries, n, &n_in_part, &n_out, err);
    *n_left_out += n_out;
    if (!st && n_in_part > 0)
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_NAMES_IN_PART,
                              "`annotate`: %d of %zu names are incomplete and preceded by their numbers (only Latin "
                              "and Greek letters are drawn; a long name needs a larger `size`)",
                              n_in_part, n);
    return st;
}

/* Adds the number of names to *n. They leave free the line of the letter at the upper edge, which long names would
 * cross, and the caption's. */
static CtsStatus name_labels(const CtsMarks *marks, const CtsModel *model, CtsPicture *band, int *n, int *n_left_out,
                             CtsReport *report, CtsError *err)
{
    const size_t n_free = marks->orientation + (marks->captions || marks->captioned_later);
    CtsLegendEntry *entries = NULL, *named;
    double rgb[3];
    size_t n_named = 0;
    int number;
    while (cts_model_label_colour(model, n_named, rgb, &number))
        n_named++;
    CtsStatus st = cts_alloc_zeroed(&entries, n_free + n_named + 1, err);
    if (st)
        return st;
    named = entries + n_free;
    for (size_t i = 0; i < n_named; i++)
        named[i].name = cts_model_label_colour(model, i, named[i].rgb, &named[i].number);
    st = draw_names(band, entries, n_free + n_named, n_left_out, report, err);
    if (!n_named)
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_MARKS_LEFT_OUT,
                              "`annotate` labels: no label has a colour of its own (`label-colours`, `label`)");
    *n += (int)n_named;
    cts_free(&entries);
    return st;
}

static void report_left_out(int n_left_out, int n, CtsReport *report)
{
    if (n_left_out > 0)
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_MARKS_LEFT_OUT,
                              "`annotate`: %d of %d marks left out for lack of room (choose a larger `size`)",
                              n_left_out, n);
}

CtsStatus cts_marks_draw(const CtsMarks *marks, const CtsModel *model, CtsPicture *band, CtsReport *report,
                         CtsError *err)
{
    int n_left_out = 0, n = 4 * marks->orientation + marks->scale;
    CtsStatus st = n ? cts_annotate(band, marks->orientation, marks->scale, &n_left_out, err) : CTS_OK;
    if (!st && marks->labels)
        st = name_labels(marks, model, band, &n, &n_left_out, report, err);
    report_left_out(n_left_out, n, report);
    return st;
}

CtsStatus cts_marks_caption(const CtsMarks *marks, const char *text, int number, CtsPicture *band, CtsReport *report,
                            CtsError *err)
{
    const double shade = band->info.light_behind ? 0 : 1;
    CtsLegendEntry lines[2] = {0};
    lines[marks->orientation] = (CtsLegendEntry){.name = text, .number = number, .rgb = {shade, shade, shade}};
    int n_left_out = 0;
    const CtsStatus st = draw_names(band, lines, marks->orientation + 1U, &n_left_out, report, err);
    report_left_out(n_left_out, 1, report);
    return st;
}
