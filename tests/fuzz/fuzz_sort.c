/* Series sorting on invented headers: 16 bytes a slice, positions, times and numbers all mixed up. */
#include "fuzz.h"
#include "input/series/series_check.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { BYTES = 16, MAX_SLICES = 60, PIXEL_BYTES = 2 * 4 * 4 };

/* Two distinguishable pictures. */
static const uint8_t pixels[2][PIXEL_BYTES] = {{1}, {2}};

static CtsSlice *invent(const uint8_t *b, int k)
{
    static const double steps_mm[] = {0, 0.001, 0.01, 0.1, 0.5, 1, 1, 2.5};
    static char paths[MAX_SLICES][16];
    CtsSlice *s = calloc(1, sizeof *s);
    if (!s)
        abort();
    snprintf(paths[k], sizeof paths[k], "IM%d", k);
    *s = cts_slice_unknown();
    s->path = paths[k];
    s->kind = CTS_OBJECT_SLICE;
    s->syntax = cts_syntax_native(true, false);
    s->rows = 4 + (b[0] == 255);
    s->columns = 4;
    s->bits_allocated = s->bits_stored = 16;
    s->high_bit = 15;
    s->padding_word = -1;
    s->slope = 1;
    s->row_spacing_mm = s->column_spacing_mm = b[1] == 255 ? 0.7 : 0.5;
    s->row_lps[0] = s->column_lps[1] = s->normal_lps[2] = 1;
    s->position_lps[0] = b[2] == 255 ? b[3] * 0.01 : 0;
    s->position_lps[1] = b[4] * steps_mm[b[5] % 4] * 0.1;
    s->position_lps[2] = (b[6] - 128) * steps_mm[b[7] % 8] + (b[8] - 128) * 1e-3;
    for (int i = 0; i < CTS_N_VOLUME_NUMBERS; i++)
        s->volume_number[i] = NAN;
    if (b[9] & 1)
        s->volume_number[CTS_ACQUISITION_NUMBER] = b[9] >> 1 & 3;
    if (b[9] >> 3 & 1)
        s->volume_number[CTS_TEMPORAL_POSITION] = b[9] >> 4 & 3;
    if (b[10])
        s->volume_number[CTS_ACQUISITION_TIME] = b[10] + 256 * (b[11] & 3);
    s->instance_number = b[12];
    s->localizer = b[13] > 250;
    s->thickness_mm = b[13] & 3;
    if (b[14] > 250)
        cts_slice_fault(s, b[14] & 1 ? CTS_ERR_PIXELS : CTS_ERR_SYNTAX, "invented");
    s->memory = pixels[b[15] & 1];
    s->file_bytes = s->pixel_bytes = PIXEL_BYTES;
    return s;
}

static int check(const CtsSeries *s)
{
    assert(s->renderable == !s->refusal && (!s->refusal || s->reason[0]));
    for (int k = 1; s->renderable && k < s->n_slices; k++)
        assert(s->slices[k]->position_lps[2] > s->slices[k - 1]->position_lps[2]);
    assert(!s->renderable || s->n_slices >= 2);
    return s->n_slices;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n)
{
    const int n_slices = n / BYTES < MAX_SLICES ? (int)(n / BYTES) : MAX_SLICES;
    int kept = 0;
    if (n_slices == 0)
        return 0;
    CtsSliceSet set = {malloc((size_t)n_slices * sizeof *set.items), n_slices};
    for (int k = 0; k < n_slices; k++)
        set.items[k] = invent(data + (size_t)k * BYTES, k);
    CtsSeriesList *list = calloc(1, sizeof *list);
    assert(list);
    CtsError err = {0};
    /* Its first byte decides, too. */
    const CtsSeriesRules rules = {.allow_missing_slices = data[0] & 1};
    const CtsStudyNumbers numbers = {0};
    assert(cts_series_check(&set, &rules, &numbers, list, &err) == CTS_OK);
    assert(list->n >= 1);
    for (size_t i = 0; i < list->n; i++)
        kept += check(&list->items[i]);
    cts_series_list_free(&list);
    assert(kept <= n_slices);
    return 0;
}
