#include "input/load/load.h"

#include "base/compare.h"
#include "base/mem.h"
#include "base/vec3.h"
#include "core/volume/threshold.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* AIR_BELOW: grey level, HU + 1024, halfway between air and water, which separates the two on any scanner. FEWEST:
 * least number of samples of air or of the body, a sixteenth of a slice's 1024; N_GREY: grey levels of 16 bits. */
enum { AIR_BELOW = 1024 - 500, FEWEST = CTS_SAMPLES / 16, N_GREY = 65536 };

typedef struct Samples {
    const CtsSlice *slices;
    const uint16_t *of; /* n * CTS_SAMPLES */
    int n;
} Samples;

static const uint16_t *sample_slice(const Samples *s, int k)
{
    return s->of + (size_t)k * CTS_SAMPLES;
}

/* A slice against its prediction from its neighbours, in half grey levels: twice the slice, the sum of both. The first
 * and the last slice have one neighbour, and the next one is used to estimate the difference of neighbours. */
typedef struct Beside {
    const uint16_t *own, *near, *other;
    bool at_end;
} Beside;

static Beside beside(const Samples *s, int k)
{
    const bool at_end = k == 0 || k == s->n - 1;
    const int near = k == 0 ? 1 : k - 1, other = !at_end ? k + 1 : k == 0 ? 2 : k - 2;
    return (Beside){sample_slice(s, k), sample_slice(s, near), sample_slice(s, other), at_end};
}

static int foretold(const Beside *b, int i)
{
    return b->near[i] + (b->at_end ? b->near[i] : b->other[i]);
}

/* Air, or body: the two levels that a rescale moves. Padding is neither. */
static bool is_in(const Beside *b, int i, bool air)
{
    const bool dark = foretold(b, i) < 2 * AIR_BELOW, is_known = b->near[i] | b->other[i];
    return (dark == air) & is_known;
}

/* Quick test: true if two of three pixels of air or of the body deviate from the prediction in the same direction, as 1
 * % of slices with 64 pixels of pure noise do. */
static bool leans(const Beside *b, bool air)
{
    int n = 0, above = 0, below = 0;
    for (int i = 0; i < CTS_SAMPLES; i++) {
        const int off = 2 * b->own[i] - foretold(b, i), in = is_in(b, i, air);
        n += in;
        above += in & (off > 0);
        below += in & (off < 0);
    }
    return n >= FEWEST && 3 * (above > below ? above : below) >= 2 * n;
}

/* The deviation of a slice in HU; 0: none. Noise and anatomy move pixels up as often as down, and neighbours differ by
 * both. A slice deviates if, in the half of the pixels where its neighbours agree best, nine of ten lie on one side
 * (noise: once in 390,000 times for 32 pixels), and their median is larger than the difference between the neighbours
 * of three of four pixels. */
static double off_by(const Beside *b, bool air)
{
    int apart[CTS_SAMPLES], off[CTS_SAMPLES], n = 0, n_off = 0, above = 0, below = 0;
    for (int i = 0; i < CTS_SAMPLES; i++)
        if (is_in(b, i, air))
            apart[n++] = abs(b->near[i] - b->other[i]);
    qsort(apart, (size_t)n, sizeof *apart, cts_compare_int);
    const int agree = apart[n / 2], differ = apart[n * 3 / 4];
    for (int i = 0; i < CTS_SAMPLES; i++)
        if (is_in(b, i, air) && abs(b->near[i] - b->other[i]) <= agree) {
            const int d = off[n_off++] = 2 * b->own[i] - foretold(b, i);
            above += d > 0;
            below += d < 0;
        }
    qsort(off, (size_t)n_off, sizeof *off, cts_compare_int);
    const double median = off[n_off / 2] / 2.0;
    return 10 * (above > below ? above : below) >= 9 * n_off && fabs(median) > differ ? median : 0;
}

static double slice_off_by(const Samples *s, int k)
{
    const Beside b = beside(s, k);
    const double body = leans(&b, false) ? off_by(&b, false) : 0, air = leans(&b, true) ? off_by(&b, true) : 0;
    return fabs(body) > fabs(air) ? body : air;
}

static void report_displacement(const Samples *s, CtsReport *report)
{
    int n_off = 0, first = -1;
    double first_by = 0;
    for (int k = 0; s->n > 2 && k < s->n; k++) {
        const bool at_end = k == 0 || k == s->n - 1;
        const double by = slice_off_by(s, k);
        /* Beside a slice that deviates, the end only seems to deviate. */
        if (by == 0 || (at_end && slice_off_by(s, k == 0 ? 1 : k - 1) != 0))
            continue;
        if (n_off++ == 0) {
            first = k;
            first_by = by;
        }
    }
    if (n_off)
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_SLICE_OFF_NEIGHBOURS,
                              "%s%s: differs by %.0f HU from the slices beside it, more than noise explains "
                              "(RescaleSlope (0028,1053) or RescaleIntercept (0028,1052) may be wrong)",
                              cts_slice_label(&s->slices[first]).text, n_off > 1 ? " and others" : "", first_by);
}

static double apart(const Samples *s, int a, int b)
{
    const uint16_t *x = sample_slice(s, a), *y = sample_slice(s, b);
    uint32_t sum = 0;
    for (int i = 0; i < CTS_SAMPLES; i++)
        sum += x[i] > y[i] ? (uint32_t)(x[i] - y[i]) : (uint32_t)(y[i] - x[i]);
    return sum;
}

/* Difference of slice q, moved to the place of slice p, from the neighbours there; q itself is skipped. */
static double fit(const Samples *s, int p, int q)
{
    return (p - 1 == q ? 0 : apart(s, p - 1, q)) + (p + 1 == q ? 0 : apart(s, q, p + 1));
}

/* Displaced slices that are compared: 120 pairs, as the time grows with their square. */
enum { MAX_DISPLACED = 16 };

typedef struct Displaced {
    double rank; /* first, as they are sorted by it */
    int k;
} Displaced;

/* Slices whose neighbours are about as similar to each other as to the slice (0.9 as in better()), or more, the most
 * outlying first. */
static int find_displaced(const Samples *s, Displaced *all)
{
    int n = 0;
    for (int k = 1; k + 1 < s->n; k++) {
        const double beside = fmin(apart(s, k - 1, k), apart(s, k, k + 1)), across = apart(s, k - 1, k + 1);
        if (beside > 0.9 * across)
            all[n++] = (Displaced){-beside / fmax(across, 1), k};
    }
    qsort(all, (size_t)n, sizeof *all, cts_compare_double);
    return n < MAX_DISPLACED ? n : MAX_DISPLACED;
}

/* Anatomy differs more over two slices than over one, so exchanging two slices makes neighbours less similar. Where it
 * makes them more similar, by a tenth of the difference, the two are in each other's place. */
static bool better(double exchanged, double now)
{
    return exchanged < 0.9 * now;
}

static void report_exchanged(const Samples *s, int p, int q, CtsReport *report)
{
    cts_report_diagnostic(report, CTS_DIAGNOSTIC_ORDER_CONFLICT,
                          "%s and %s fit each other's place better than their own: their positions (0020,0032) may be "
                          "exchanged",
                          cts_slice_label(&s->slices[p]).text, cts_slice_label(&s->slices[q]).text);
}

/* Of slices that lie beside each other. */
static void report_adjacent(const Samples *s, int *n_found, CtsReport *report)
{
    int first = -1;
    *n_found = 0;
    for (int k = 1; k + 2 < s->n; k++)
        if (better(apart(s, k - 1, k + 1) + apart(s, k, k + 2), apart(s, k - 1, k) + apart(s, k + 1, k + 2)))
            first = (*n_found)++ ? first : k;
    /* From a quarter of the stack on, the scanner acquired slices alternately. */
    if (*n_found && 4 * *n_found < s->n)
        report_exchanged(s, first, first + 1, report);
}

static bool report_pair(const Samples *s, int a, int b, CtsReport *report)
{
    const int p = a < b ? a : b, q = a < b ? b : a;
    if (q - p < 2 || !better(fit(s, p, q) + fit(s, q, p), fit(s, p, p) + fit(s, q, q)))
        return false;
    report_exchanged(s, p, q, report);
    return true;
}

static CtsStatus report_order(const Samples *s, CtsReport *report, CtsError *err)
{
    int n_found = 0;
    Displaced *displaced = NULL;
    if (s->n < 5) /* of 4 slices, one exchange is a quarter of the stack (report_adjacent()) */
        return CTS_OK;
    const CtsStatus st = cts_alloc_array(&displaced, (size_t)s->n, err);
    if (st)
        return st;
    report_adjacent(s, &n_found, report);
    const int n_displaced = n_found ? 0 : find_displaced(s, displaced);
    for (int i = 0, reported = 0; i < n_displaced; i++)
        for (int j = 0; j < i && !reported; j++)
            reported = report_pair(s, displaced[i].k, displaced[j].k, report);
    cts_free(&displaced);
    return CTS_OK;
}

/* Histogram of the samples of all slices; of the pictures' margin alone, or all. */
static uint64_t count_levels(const Samples *s, bool rim, uint32_t *level)
{
    uint64_t n = 0;
    for (int k = 0; k < s->n; k++)
        for (int j = 0; j < CTS_SAMPLE_SIDE; j++) {
            const bool edge = j == 0 || j == CTS_SAMPLE_SIDE - 1;
            for (int i = 0; i < CTS_SAMPLE_SIDE; i += rim && !edge ? CTS_SAMPLE_SIDE - 1 : 1) {
                const uint16_t grey = sample_slice(s, k)[j * CTS_SAMPLE_SIDE + i];
                level[grey] += grey > 0;
                n += grey > 0;
            }
        }
    return n;
}

static uint64_t count_between(const uint32_t *level, int low, int high)
{
    uint64_t n = 0;
    for (int g = low < 0 ? 0 : low; g < high && g < N_GREY; g++)
        n += level[g];
    return n;
}

/* The grey level around the body: the median of the margin; -1 where the margin is only padding. */
static int border_level(const uint32_t *level, uint64_t n)
{
    uint64_t below = 0;
    for (int g = 1; g < N_GREY && n; g++)
        if ((below += level[g]) * 2 >= n)
            return g;
    return -1;
}

/* A whole body has air around it, and water 1000 HU above the air with little between (200 to 800 HU); in a field of
 * view within the body, bone that much above the tissue has spongy bone between. And where there is bone, 500 HU above
 * the level around the body, there is also air or fat, or noise about water: values below 0. Shares of 1 % of the
 * samples, and of 0.1 % below 0, exceed single damaged pixels. */
static void report_hu(const Samples *s, uint32_t *level, int rim, CtsReport *report)
{
    if (rim < AIR_BELOW)
        return;
    memset(level, 0, N_GREY * sizeof *level);
    const uint64_t n = count_levels(s, false, level);
    if (count_between(level, 1, AIR_BELOW) * 100 > n) /* there is air, and only filling around it */
        return;
    const uint64_t body = count_between(level, rim + 900, rim + 1200),
                   between = count_between(level, rim + 200, rim + 800);
    const bool none_below_0 = count_between(level, 0, 1024) * 1000 < n,
               bone = count_between(level, rim + 500, N_GREY) * 100 > n;
    if ((body * 100 > n && body > between) || (none_below_0 && bone))
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_HU_IMPLAUSIBLE,
                              "no air: what surrounds the body has %d HU, and the body far more "
                              "(RescaleIntercept (0028,1052) may be lost)",
                              rim - 1024);
}

/* The body's extent along columns or rows, in samples of at least this level: from the first to the last hundredth. */
static int body_samples(const Samples *s, bool rows, int level)
{
    uint64_t count[CTS_SAMPLE_SIDE] = {0}, n = 0, below = 0;
    int first = -1, last = -1;
    for (int k = 0; k < s->n; k++)
        for (int i = 0; i < CTS_SAMPLES; i++) {
            const int in = sample_slice(s, k)[i] >= level;
            count[rows ? i / CTS_SAMPLE_SIDE : i % CTS_SAMPLE_SIDE] += (uint64_t)in;
            n += (uint64_t)in;
        }
    for (int i = 0; i < CTS_SAMPLE_SIDE; below += count[i++]) {
        first = first < 0 && (below + count[i]) * 100 > n ? i : first;
        last = below * 100 < n * 99 ? i : last;
    }
    return n ? last - first + 1 : 0;
}

static double mean_gap_mm(const Samples *s)
{
    double line[3];
    cts_sub3(s->slices[s->n - 1].position_lps, s->slices[0].position_lps, line);
    return s->n > 1 ? cts_norm3(line) / (s->n - 1) : 0;
}

/* The body's size along columns and rows. */
static void find_size(const Samples *s, int level, double size_mm[2])
{
    const CtsSlice *m = &s->slices[s->n / 2];
    size_mm[0] = m->columns * m->column_spacing_mm * body_samples(s, false, level) / CTS_SAMPLE_SIDE;
    size_mm[1] = m->rows * m->row_spacing_mm * body_samples(s, true, level) / CTS_SAMPLE_SIDE;
}

/* True for a micro-CT specimen: a mouse, a tooth. */
static bool is_specimen(const Samples *s, double gap_mm)
{
    const CtsSlice *m = &s->slices[s->n / 2];
    const double spacing_mm[3] = {m->column_spacing_mm, m->row_spacing_mm, gap_mm};
    double size_mm[3] = {0, 0, gap_mm * s->n};
    find_size(s, 1024 + (int)CTS_DENSE_HU, size_mm);
    return cts_is_specimen(spacing_mm, size_mm);
}

/* Uses the size of the body, since small isotropic spacings are real in micro-CT. A body that would be narrower than a
 * scanner's bore of 700 mm if its unit were metres is in metres; one that would lie completely within a field of view
 * of 500 mm in centimetres is in centimetres, unless it has a micro-CT's voxels. A gap of less than a twentieth of a
 * pixel is in metres, which change it by 1000; with a micro-CT's voxels, of less than a third in centimetres, which
 * change it by 10. Voxels of a micro-CT are cubes: no edge is longer than 1.5 others. */
static void report_spacing(const Samples *s, int rim, CtsReport *report)
{
    const CtsSlice *m = &s->slices[s->n / 2];
    const double gap_mm = mean_gap_mm(s), pixel_mm = fmax(m->column_spacing_mm, m->row_spacing_mm);
    const double field_mm = fmax(m->columns * m->column_spacing_mm, m->rows * m->row_spacing_mm);
    if (field_mm > 50 && gap_mm * 20 >= pixel_mm)
        return; /* for a body of any size */
    double size_mm[2];
    find_size(s, AIR_BELOW, size_mm);
    const double body_mm = fmax(size_mm[0], size_mm[1]), longer = fmax(gap_mm / pixel_mm, pixel_mm / gap_mm);
    const char *lengths = NULL;
    if (is_specimen(s, gap_mm)) /* no scanner's slices lie so much closer than its pixels */
        lengths = gap_mm * 3 < pixel_mm ? "the positions (0020,0032) may be in centimetres" : NULL;
    else if (body_mm > 0 && body_mm < 0.7)
        lengths = "PixelSpacing (0028,0030) may be in metres";
    else if (gap_mm * 20 < pixel_mm)
        lengths = "the positions (0020,0032) may be in metres";
    else if (body_mm > 0 && rim >= 0 && rim < AIR_BELOW && field_mm <= 50 && longer > 1.5)
        lengths = "lengths may be in centimetres";
    if (lengths && s->n > 1)
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_SPACING_IMPLAUSIBLE,
                              "the body is %.3g mm wide and %.3g mm high, its slices %.3g mm apart: %s", size_mm[0],
                              size_mm[1], gap_mm, lengths);
}

/* Numbers that rise or fall with the positions confirm them: of MR, whose noise and shading from slice to slice make
 * some neighbours look exchanged. */
static bool numbers_confirm(const Samples *s)
{
    int n_rising = 0, n_falling = 0;
    for (int k = 1; k < s->n; k++) {
        n_rising += s->slices[k].instance_number > s->slices[k - 1].instance_number;
        n_falling += s->slices[k].instance_number < s->slices[k - 1].instance_number;
    }
    return n_rising == s->n - 1 || n_falling == s->n - 1;
}

CtsStatus cts_slice_consistency_report(const CtsSlice *slices, int n, const uint16_t *samples, bool is_hu,
                                       CtsReport *report, CtsError *err)
{
    const Samples s = {slices, samples, n};
    uint32_t *level = NULL;
    CtsStatus st = report ? cts_alloc_zeroed(&level, N_GREY, err) : CTS_OK;
    if (!report || st || ((is_hu || !numbers_confirm(&s)) && (st = report_order(&s, report, err))) || !is_hu)
        goto end;
    report_displacement(&s, report);
    const int rim = border_level(level, count_levels(&s, true, level));
    report_hu(&s, level, rim, report);
    report_spacing(&s, rim, report);
end:
    cts_free(&level);
    return st;
}
