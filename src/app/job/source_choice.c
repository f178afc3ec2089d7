/* The text by which processed volumes are found again: what the volume depends on after the scan. unit/test_options
 * looks for each option that remakes the volume. */
#include "app/job/pipeline.h"
#include "base/text.h"
#include <stdio.h>

static void print_label_choice(FILE *out, const CtsLabelChoice *choice)
{
    const char *const lists[] = {choice->show, choice->hide, choice->order};
    for (int i = 0; i < 3; i++)
        fprintf(out, "%c%s\n", lists[i] ? '+' : '-', lists[i] ? lists[i] : "");
    for (int i = 0; i < choice->n_appearances; i++)
        fprintf(out, "%s\n", choice->appearances[i]);
    fprintf(out, "%d %d\n", choice->show_present, choice->own_colours);
}

char *cts_source_choice(const CtsSource *source)
{
    const CtsCropBox *const crop = &source->crop;
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
    print_label_choice(out, &source->choice);
    return cts_text_end(out, &text);
}
