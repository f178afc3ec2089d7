/* The fields of CtsSource, each with the first stage that depends on it, and the text by which processed volumes are
 * found again. A field without a row does not compile. */
#include "app/job/pipeline.h"
#include <stdio.h>
#include <stdlib.h>

/* row(field, first stage to be remade), in the order of the fields. */
/* clang-format off */
#define ROWS(row)                                                                                                      \
    row(paths, SCAN)                                                                                                   \
    row(n_paths, SCAN)                                                                                                 \
    row(from, SCAN)                                                                                                    \
    row(net, NOTHING)                                                                                                  \
    row(study_uid, SCAN)                                                                                               \
    row(peer_series_uid, SCAN)                                                                                         \
    row(series_uid, SCAN)                                                                                              \
    row(labels, SCAN)                                                                                                  \
    row(n_labels, SCAN)                                                                                                \
    row(labels_listed, SCAN)                                                                                           \
    row(archives, NOTHING)                                                                                             \
    row(labels_unnamed, NOTHING)                                                                                       \
    row(label_names, SCAN)                                                                                             \
    row(choice, VOLUME)                                                                                                \
    row(stop, NOTHING)                                                                                                 \
    row(rules, SCAN)                                                                                                   \
    row(n_threads, NOTHING)                                                                                            \
    row(remove_table, VOLUME)                                                                                          \
    row(table_kept_by, NOTHING)                                                                                        \
    row(crops_air, VOLUME)                                                                                             \
    row(inside_unseen, VOLUME)                                                                                         \
    row(interpolation, VOLUME)                                                                                         \
    row(smooth_mm, VOLUME)                                                                                             \
    row(crop, VOLUME)                                                                                                  \
    row(fill, VOLUME)
/* clang-format on */

/* A struct of the rows' fields has the layout of the source only if the rows are in the same order. */
#define SAME_FIELD(field, remakes) __typeof__(((CtsSource *)0)->field) field;
struct Mirror {
    ROWS(SAME_FIELD)
};
#define SAME_PLACE(field, remakes)                                                                                     \
    _Static_assert(offsetof(struct Mirror, field) == offsetof(CtsSource, field), #field ": row out of order");
ROWS(SAME_PLACE)

static void print_bool(FILE *out, const bool *is_on)
{
    fprintf(out, "%d\n", *is_on);
}

static void print_interpolation(FILE *out, const CtsInterpolation *interpolation)
{
    fprintf(out, "%d\n", (int)*interpolation);
}

static void print_number(FILE *out, const double *number)
{
    fprintf(out, "%a\n", *number);
}

static void print_crop(FILE *out, const CtsCropBox *crop)
{
    for (int i = 0; crop->given && i < 3; i++)
        fprintf(out, "%a %a ", crop->low_lps[i], crop->high_lps[i]);
    fprintf(out, "\n");
}

static void print_fill(FILE *out, const CtsFillValue *fill)
{
    fprintf(out, "%d %a\n", fill->given, fill->given ? fill->hu : 0);
}

static void print_choice(FILE *out, const CtsLabelChoice *choice)
{
    const char *const lists[] = {choice->show, choice->hide, choice->order};
    for (int i = 0; i < 3; i++)
        fprintf(out, "%c%s\n", lists[i] ? '+' : '-', lists[i] ? lists[i] : "");
    for (int i = 0; i < choice->n_appearances; i++)
        fprintf(out, "%s\n", choice->appearances[i]);
    fprintf(out, "%d %d\n", choice->show_present, choice->own_colours);
}

/* Prints what a volume depends on, of any type that a field of this stage has. */
#define PRINT_VOLUME(at)                                                                                               \
    _Generic((at), const bool * : print_bool, const double * : print_number, const CtsInterpolation *                  \
             : print_interpolation, const CtsCropBox * : print_crop, const CtsFillValue * : print_fill,                \
               const CtsLabelChoice * : print_choice)(out, at);
#define PRINT_SCAN(at)
#define PRINT_NOTHING(at)

/* By position, so that a field without a row is missing. */
#pragma GCC diagnostic error "-Wmissing-field-initializers"
#define VALUE(field, remakes) source->field,

char *cts_source_choice(const CtsSource *source)
{
    const CtsSource rows = {ROWS(VALUE)};
    char *text = NULL;
    size_t size = 0;
    FILE *const out = open_memstream(&text, &size);
    if (!out)
        return NULL;
#define PRINT(field, remakes) PRINT_##remakes(&rows.field)
    ROWS(PRINT)
    if (fclose(out)) {
        free(text);
        return NULL;
    }
    return text;
}
