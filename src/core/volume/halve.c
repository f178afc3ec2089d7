#include "core/volume/halve.h"

#include "base/cpu.h"
#include "base/mem.h"
#include "base/parallel.h"
#include "core/volume/volume_new.h"
#include <math.h>
#include <stdbool.h>
#if defined(__x86_64__)
#include <immintrin.h>
#endif

/* Node i is made of the voxels 2 i - BEFORE to 2 i - BEFORE + TAPS - 1. */
enum { TAPS = 6, PAIRS = TAPS / 2, BEFORE = 3 };
/* Weights are whole numbers of 2^-14. */
enum { ONE_BITS = 14, ONE = 1 << ONE_BITS };
/* Between axes grey levels are 32768 less, so that products of 16-bit numbers can be summed in pairs: weights come to
 * 1.5 in magnitude at most, and 1.5 * 2^14 * 2^15 fits 31 bits. */
enum { BIAS = 32768 };
/* Nodes of a slice that are kept while slices are summed up: what six slices of them take fits a second-level cache. */
enum { BLOCK_NODES = 16384 };

/* Pairs of weights stand side by side, node by node. */
typedef struct Axis {
    int n, n_nodes;
    bool halved;
    int16_t *weight[PAIRS]; /* taps 2 p and 2 p + 1 of node i at [p][2 i]; of an axis that is kept, tap 0 of all is 1 */
} Axis;

/* A row of voxels to nodes. */
typedef void (*columns_fn)(int16_t *to, const uint16_t *row, const Axis *axis);
/* n voxels of a node across lines, which are all as long. to may not be one of them. */
typedef void (*across_fn)(uint16_t *to, const int16_t *const lines[TAPS], int n, const int16_t weight[TAPS],
                          uint16_t bias);

static inline int first_voxel(const Axis *axis, int node)
{
    const int first = 2 * node - BEFORE;
    return !axis->halved ? node : first < 0 ? 0 : first;
}

static inline int last_voxel(const Axis *axis, int node)
{
    const int last = 2 * node - BEFORE + TAPS - 1;
    return !axis->halved ? node : last < axis->n ? last : axis->n - 1;
}

/* Where a tap of a node looks: beyond the border the last voxel goes on. */
static inline int tap_voxel(const Axis *axis, int node, int tap)
{
    const int at = 2 * node - BEFORE + tap, first = first_voxel(axis, node), last = last_voxel(axis, node);
    return at < first ? first : at > last ? last : at;
}

static inline int32_t rounded(int32_t sum)
{
    const int32_t level = (sum + ONE / 2) >> ONE_BITS;
    return level < -BIAS ? -BIAS : level > BIAS - 1 ? BIAS - 1 : level;
}

/* Nodes first to end - 1 of a halved axis have all their voxels; there may be none. */
static inline void inner_nodes(const Axis *axis, int *first, int *end)
{
    *first = *end = axis->n_nodes;
    if (axis->n > TAPS) {
        *first = (BEFORE + 1) / 2;
        *end = (axis->n - TAPS + BEFORE) / 2 + 1;
    }
}

static void border_columns(int16_t *to, const uint16_t *row, const Axis *axis, int first, int end)
{
    for (int i = first; i < end; i++) {
        int32_t sum = 0;
        for (int t = 0; t < TAPS; t++)
            sum += axis->weight[t / 2][2 * i + t % 2] * (row[tap_voxel(axis, i, t)] - BIAS);
        to[i] = (int16_t)rounded(sum);
    }
}

/* The columns of an axis that is kept. */
static void same_columns(int16_t *to, const uint16_t *row, const Axis *axis)
{
    for (int i = 0; i < axis->n; i++)
        to[i] = (int16_t)(row[i] - BIAS);
}

static void columns_plain(int16_t *to, const uint16_t *row, const Axis *axis)
{
    int first, end;
    inner_nodes(axis, &first, &end);
    border_columns(to, row, axis, 0, first);
    for (int i = first; i < end; i++) {
        int32_t sum = 0;
        for (int t = 0; t < TAPS; t++)
            sum += axis->weight[t / 2][2 * i + t % 2] * (row[2 * i - BEFORE + t] - BIAS);
        to[i] = (int16_t)rounded(sum);
    }
    border_columns(to, row, axis, end, axis->n_nodes);
}

static void across_plain(uint16_t *to, const int16_t *const lines[TAPS], int n, const int16_t weight[TAPS],
                         uint16_t bias)
{
    for (int i = 0; i < n; i++) {
        int32_t sum = 0;
        for (int t = 0; t < TAPS; t++)
            sum += weight[t] * lines[t][i];
        to[i] = (uint16_t)(rounded(sum) + bias);
    }
}

#if defined(__x86_64__)
enum { LANES = 16 };

__attribute__((target("avx2"), always_inline)) static inline __m256i rounded_avx2(__m256i sum)
{
    return _mm256_srai_epi32(_mm256_add_epi32(sum, _mm256_set1_epi32(ONE / 2)), ONE_BITS);
}

/* Eight nodes from i on. */
__attribute__((target("avx2"), always_inline)) static inline __m256i eight_columns(const uint16_t *row,
                                                                                   const Axis *axis, int i)
{
    const __m256i bias = _mm256_set1_epi16((int16_t)-BIAS);
    __m256i sum = _mm256_setzero_si256();
    for (int p = 0; p < PAIRS; p++) {
        const __m256i voxels = _mm256_loadu_si256((const void *)(row + 2 * i - BEFORE + 2 * p));
        const __m256i weights = _mm256_loadu_si256((const void *)(axis->weight[p] + 2 * i));
        sum = _mm256_add_epi32(sum, _mm256_madd_epi16(_mm256_xor_si256(voxels, bias), weights));
    }
    return rounded_avx2(sum);
}

__attribute__((target("avx2"))) static void columns_avx2(int16_t *to, const uint16_t *row, const Axis *axis)
{
    int first, end;
    inner_nodes(axis, &first, &end);
    if (end - first < LANES) {
        columns_plain(to, row, axis);
        return;
    }
    /* The last vector may overlap the one before. */
    for (int i = first; i < end; i += LANES) {
        const int at = i + LANES <= end ? i : end - LANES;
        const __m256i packed = _mm256_packs_epi32(eight_columns(row, axis, at), eight_columns(row, axis, at + 8));
        _mm256_storeu_si256((void *)(to + at), _mm256_permute4x64_epi64(packed, _MM_SHUFFLE(3, 1, 2, 0)));
    }
    border_columns(to, row, axis, 0, first);
    border_columns(to, row, axis, end, axis->n_nodes);
}

__attribute__((target("avx2"))) static void across_avx2(uint16_t *to, const int16_t *const lines[TAPS], int n,
                                                        const int16_t weight[TAPS], uint16_t bias)
{
    if (n < LANES) {
        across_plain(to, lines, n, weight, bias);
        return;
    }
    __m256i pair[PAIRS];
    for (int p = 0; p < PAIRS; p++)
        pair[p] = _mm256_set1_epi32((int)((uint16_t)weight[2 * p] | (uint32_t)(uint16_t)weight[2 * p + 1] << 16));
    for (int i = 0; i < n; i += LANES) {
        const int at = i + LANES <= n ? i : n - LANES;
        __m256i low = _mm256_setzero_si256(), high = low;
        for (int p = 0; p < PAIRS; p++) {
            const __m256i a = _mm256_loadu_si256((const void *)(lines[2 * p] + at));
            const __m256i b = _mm256_loadu_si256((const void *)(lines[2 * p + 1] + at));
            low = _mm256_add_epi32(low, _mm256_madd_epi16(_mm256_unpacklo_epi16(a, b), pair[p]));
            high = _mm256_add_epi32(high, _mm256_madd_epi16(_mm256_unpackhi_epi16(a, b), pair[p]));
        }
        const __m256i packed = _mm256_packs_epi32(rounded_avx2(low), rounded_avx2(high));
        _mm256_storeu_si256((void *)(to + at), _mm256_xor_si256(packed, _mm256_set1_epi16((int16_t)bias)));
    }
}
#endif

/* One volume being halved. A worker goes up the slices of a block of rows, whose nodes along columns and rows it keeps
 * for as many slices as a node has taps. */
typedef struct Halving {
    const uint16_t *from;
    uint16_t *to;
    Axis axis[3];
    columns_fn columns;
    across_fn across;
    int block_rows, n_blocks; /* rows of nodes */
    int16_t *scratch;         /* scratch_size for each worker: rows of one slice, then the blocks of the slices */
    size_t scratch_size;
} Halving;

/* The node's lines out of a ring of as many as it has taps. */
static void across(const Halving *h, const Axis *axis, int node, const int16_t *ring, size_t ring_step, uint16_t *to,
                   uint16_t bias)
{
    const int16_t *lines[TAPS];
    int16_t weight[TAPS];
    for (int t = 0; t < TAPS; t++) {
        lines[t] = ring + (size_t)(tap_voxel(axis, node, t) % TAPS) * ring_step;
        weight[t] = axis->weight[t / 2][2 * node + t % 2];
    }
    h->across(to, lines, h->axis[0].n_nodes, weight, bias);
}

/* Rows first to end - 1 of nodes, of one slice of voxels. */
static void halve_slice(const Halving *h, const uint16_t *slice, int first, int end, int16_t *rows, int16_t *made)
{
    const Axis *const axis = &h->axis[1];
    const size_t nx = (size_t)h->axis[0].n, n_nodes = (size_t)h->axis[0].n_nodes;
    for (int j = first, row = first_voxel(axis, first); j < end; j++, made += n_nodes) {
        if (!axis->halved) {
            h->columns(made, slice + (size_t)j * nx, &h->axis[0]);
            continue;
        }
        for (; row <= last_voxel(axis, j); row++)
            h->columns(rows + (size_t)(row % TAPS) * n_nodes, slice + (size_t)row * nx, &h->axis[0]);
        across(h, axis, j, rows, n_nodes, (uint16_t *)made, 0);
    }
}

/* Item: a block, and in it a slice of nodes. */
static void halve_some(void *context, int worker, size_t first, size_t end)
{
    const Halving *const h = context;
    const Axis *const x = &h->axis[0], *const y = &h->axis[1], *const z = &h->axis[2];
    const size_t row_nodes = (size_t)x->n_nodes, block = (size_t)h->block_rows * row_nodes;
    int16_t *const rows = h->scratch + (size_t)worker * h->scratch_size, *const slices = rows + TAPS * row_nodes;
    int slice = 0;
    for (size_t item = first; item < end; item++) {
        const int j = (int)(item / (size_t)z->n_nodes) * h->block_rows, k = (int)(item % (size_t)z->n_nodes);
        const int end_j = j + h->block_rows < y->n_nodes ? j + h->block_rows : y->n_nodes;
        if (item == first || k == 0)
            slice = first_voxel(z, k);
        for (; slice <= last_voxel(z, k); slice++)
            halve_slice(h, h->from + (size_t)slice * (size_t)x->n * (size_t)y->n, j, end_j, rows,
                        slices + (size_t)(slice % TAPS) * block);
        uint16_t *to = h->to + ((size_t)k * (size_t)y->n_nodes + (size_t)j) * row_nodes;
        for (int row = 0; row < end_j - j; row++, to += row_nodes)
            across(h, z, k, slices + (size_t)row * row_nodes, block, to, BIAS);
    }
}

/* Where node i's look at half step m lies is told in whole numbers of 1 / d voxels, so weights are exact but for their
 * last rounding, which goes to the largest. */
static void find_weights(Axis *axis, int node)
{
    static const int low_pass[5] = {-1, 2, 6, 2, -1};
    const int64_t d = 2 * ((int64_t)axis->n_nodes - 1);
    int64_t weight[TAPS + 1] = {0}, sum = 0;
    for (int m = 0; m < 5; m++) {
        const int64_t at = (2 * (int64_t)node + m - 2) * (axis->n - 1) - (2 * (int64_t)node - BEFORE) * d;
        weight[at / d] += low_pass[m] * (d - at % d);
        weight[at / d + 1] += low_pass[m] * (at % d);
    }
    int largest = 0;
    for (int t = 0; t < TAPS; t++) {
        largest = weight[t] > weight[largest] ? t : largest;
        const int64_t w = (int64_t)floor((double)weight[t] * ONE / (8 * (double)d) + 0.5);
        axis->weight[t / 2][2 * node + t % 2] = (int16_t)w;
        sum += w;
    }
    axis->weight[largest / 2][2 * node + largest % 2] += (int16_t)(ONE - sum);
}

static CtsStatus make_axis(Axis *axis, CtsError *err)
{
    CtsStatus st = CTS_OK;
    for (int p = 0; p < PAIRS && !st; p++)
        st = cts_alloc_zeroed(&axis->weight[p], 2 * (size_t)axis->n_nodes, err);
    for (int i = 0; i < axis->n_nodes && !st; i++)
        if (axis->halved)
            find_weights(axis, i);
        else
            axis->weight[0][2 * i] = ONE;
    return st;
}

/* Which axes are halved, and the place of what comes of it. */
static void find_axes(const CtsVolume *v, Axis axes[3])
{
    const double finest_mm =
        fmin(fmin(cts_volume_spacing_mm(v, 0), cts_volume_spacing_mm(v, 1)), cts_volume_spacing_mm(v, 2));
    for (int a = 0; a < 3; a++) {
        const int n = v->dims[a];
        const bool halved = n >= 3 && cts_volume_spacing_mm(v, a) < 1.5 * finest_mm;
        axes[a] = (Axis){.n = n, .n_nodes = halved ? n / 2 + 1 : n, .halved = halved};
    }
}

static void place(CtsVolume *half, const CtsVolume *v)
{
    for (int c = 0; c < 3; c++)
        half->origin_lps[c] = v->origin_lps[c];
    double step[3];
    for (int a = 0; a < 3; a++) {
        step[a] = half->dims[a] < v->dims[a] ? (v->dims[a] - 1.0) / (half->dims[a] - 1) : 1;
        for (int c = 0; c < 3; c++)
            half->step_lps[a][c] = v->step_lps[a][c] * step[a];
    }
    half->slice_layers = (int)fmax(floor(v->slice_layers / step[2] + 0.5), 1);
    half->hu_offset = v->hu_offset;
    half->hu_step = v->hu_step;
    half->hu_min = v->hu_min;
    half->hu_max = v->hu_max;
}

/* Blocks of rows that are as even as they can be, each of some BLOCK_NODES and sixteen rows at least, as the rows
 * around a block are made for it alone. */
static void find_blocks(Halving *h)
{
    const int rows = h->axis[1].n_nodes, fitting = BLOCK_NODES / h->axis[0].n_nodes;
    const int most = fitting > 16 ? fitting : 16;
    const int n_blocks = rows / most + (rows % most > 0);
    h->block_rows = rows / n_blocks + (rows % n_blocks > 0);
    h->n_blocks = rows / h->block_rows + (rows % h->block_rows > 0);
    h->scratch_size = (size_t)h->axis[0].n_nodes * TAPS * ((size_t)h->block_rows + 1);
}

static CtsStatus check_memory(const Axis axes[3], CtsError *err)
{
    const double need = 2.0 * axes[0].n_nodes * axes[1].n_nodes * axes[2].n_nodes;
    const uint64_t free_bytes = cts_memory_available();
    if (!cts_memory_allows(need, free_bytes))
        return cts_fail(err, CTS_ERR_MEMORY, "the volume at half its resolution needs %.0f MiB, and %.0f MiB are free",
                        need / 1048576, (double)free_bytes / 1048576);
    return CTS_OK;
}

CtsStatus cts_volume_halve(const CtsVolume *volume, int n_threads, CtsVolume **half, CtsError *err)
{
    *half = NULL;
    CtsStatus st;
    CtsVolume *v = NULL;
    Halving h = {.from = volume->grey, .columns = columns_plain, .across = across_plain};
#if defined(__x86_64__)
    if (cts_cpu_flags() & CTS_CPU_AVX2) {
        h.columns = columns_avx2;
        h.across = across_avx2;
    }
#endif
    n_threads = cts_threads(n_threads);
    find_axes(volume, h.axis);
    if (!h.axis[0].halved)
        h.columns = same_columns;
    find_blocks(&h);
    if ((st = check_memory(h.axis, err)) ||
        (st = cts_volume_new_unset(&v, h.axis[0].n_nodes, h.axis[1].n_nodes, h.axis[2].n_nodes, err)) ||
        (st = make_axis(&h.axis[0], err)) || (st = make_axis(&h.axis[1], err)) || (st = make_axis(&h.axis[2], err)) ||
        (st = cts_alloc_array(&h.scratch, (size_t)n_threads * h.scratch_size, err)))
        goto end;
    h.to = v->grey;
    place(v, volume);
    cts_parallel(n_threads, (size_t)h.n_blocks * (size_t)h.axis[2].n_nodes, 0, halve_some, &h);
end:
    if (st)
        cts_volume_free(&v);
    *half = v;
    for (int a = 0; a < 3; a++)
        for (int p = 0; p < PAIRS; p++)
            cts_free(&h.axis[a].weight[p]);
    cts_free(&h.scratch);
    return st;
}
