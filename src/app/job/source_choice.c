/* The text by which processed volumes are found again: what the volume depends on after the scan. unit/test_options
 * looks for each option that remakes the volume. */
#include "app/job/pipeline.h"
#include "base/text.h"
#include <stdio.h>

char *cts_source_choice(const CtsSource *source)
{
    const CtsCropBox *const crop = &source->crop;
    const CtsLabelChoice *const labels = &source->choice;
    const char *const lists[] = {labels->show, labels->hide, labels->order};
    char *text = NULL;
    size_t size = 0;
    FILE *const out = open_memstream(&text, &size);
    if (!out)
        return NULL;
    fprintf(out, "%d %d %d %d %a\n", source->remove_table, source->crops_air, source->without_body,
            (int)source->interpolation, source->smooth_mm);
    for (int i = 0; crop->given && i < 3; i++)
        fprintf(out, "%a %a ", crop->low_lps[i], crop->high_lps[i]);
    fprintf(out, "\n%d %a\n", source->fill.given, source->fill.given ? source->fill.hu : 0);
    for (int i = 0; i < 3; i++)
        fprintf(out, "%c%s\n", lists[i] ? '+' : '-', lists[i] ? lists[i] : "");
    for (int i = 0; i < labels->n_appearances; i++)
        fprintf(out, "%s\n", labels->appearances[i]);
    fprintf(out, "%d %d\n", labels->show_present, labels->own_colours);
    return cts_text_end(out, &text);
}
