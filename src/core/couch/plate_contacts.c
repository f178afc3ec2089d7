#include "core/couch/table_removal.h"

/* Number of voxels by which the far face of a plate may waver; nothing may lie behind them. Measured: 3 to 6 differ by
 * less than 0.3 % of a holder, 1 leaves a sixth of it. */
enum { WAVER = 3 };
/* Number of steps from a plate's end over which it may taper. Measured: 30 to 100 differ by less than 0.2 % of a
 * holder, 5 leave an eighth of it. */
enum { TAPER = 40 };

/* Orientation of the search in a section: plates run along `axis`, their far face is towards larger (side 1) or smaller
 * (-1) coordinates across; they are followed to larger (way 1) or smaller (-1) coordinates along. */
typedef struct Face {
    const CtsBits *always, *ever;
    CtsBits *plates;
    int axis, side, way;
} Face;

static bool get(const Face *f, const CtsBits *bits, int along, int across)
{
    const int i = f->axis ? across : along, j = f->axis ? along : across;
    return i >= 0 && j >= 0 && i < bits->dims[0] && j < bits->dims[1] && cts_bits_get(bits, i, j, 0);
}

static bool is_face(const Face *f, int along, int across)
{
    return get(f, f->always, along, across) && !get(f, f->always, along, across + f->side);
}

/* Follows the face one step from *across; false where it ends or another voxel lies behind it. */
static bool follow_face(const Face *f, int along, int *across)
{
    const int at[3] = {*across, *across + f->side, *across - f->side};
    for (int n = 0; n < 3; n++)
        if (is_face(f, along, at[n])) {
            *across = at[n];
            return !get(f, f->ever, along, at[n] + WAVER * f->side);
        }
    return false;
}

/* Distance behind the face at which a plate begins that was found in a longer window, where it wavers; more than WAVER
 * without a plate. */
static int recess(const Face *f, int along, int across)
{
    int n = 0;
    while (n <= WAVER && !get(f, f->plates, along, across - n * f->side))
        n++;
    return n;
}

/* The plate's thickness near its end at (along, across), where it may taper: the largest within some steps. 0 where it
 * is not longer along than across, like a plate in the other direction. */
static int thickness(const Face *f, int along, int across, int step)
{
    int most = 0, s = 0, n;
    for (; s <= TAPER && (n = recess(f, along, across)) <= WAVER; s++) {
        while (get(f, f->plates, along, across - n * f->side))
            n++;
        most = n > most ? n : most;
        along += step;
        if (!follow_face(f, along, &across))
            break;
    }
    return s > most ? most : 0;
}

/* Number of voxels that are set in all sections from the face on, at most n_most. */
static int depth(const Face *f, int along, int across, int n_most)
{
    int n = 0;
    while (n < n_most && get(f, f->always, along, across - n * f->side))
        n++;
    return n;
}

static void set_strip(const Face *f, int along, int across, int thick)
{
    for (int n = 0; n < depth(f, along, across, thick); n++) {
        const int c = across - n * f->side;
        cts_bits_set(f->plates, f->axis ? c : along, f->axis ? along : c, 0);
    }
}

/* From the plate's end at (along, across): continues over the thin part, and through a thicker one up to the next plate
 * or to where it is as thin as before, and so on. Sets the strip's bits. */
static void bridge(const Face *f, int along, int across)
{
    const int left = thickness(f, along, across, -f->way);
    int end = along + f->way, at = across, thin = 0, n;
    bool met = false;
    if (!left || !follow_face(f, end, &at))
        return;
    while (!met) {
        while (!(met = get(f, f->plates, end, at)) && (n = depth(f, end, at, left + 2)) <= left + 1) {
            set_strip(f, end, at, left + 1);
            thin = n > thin ? n : thin;
            along = end;
            across = at;
            end += f->way;
            if (!follow_face(f, end, &at))
                return;
        }
        while (!(met = get(f, f->plates, end, at)) && depth(f, end, at, left + 2) > left + 1) {
            end += f->way;
            if (!follow_face(f, end, &at))
                return;
        }
        /* A curved plate is less thick here than further away, measured across. */
        int thick = thin && thin < left ? thin : left;
        if (met && (n = thickness(f, end, at, f->way)))
            thick = n < thick ? n : thick;
        /* The voxel that was added on the near side is the patient's. */
        for (along += f->way; along != end; along += f->way) {
            follow_face(f, along, &across);
            set_strip(f, along, across, thick - 1);
        }
        along -= f->way;
    }
}

/* Rows outside are 0. The words -1 and row_words are those of other rows: of the former only the spare last bit is
 * used, which is 0, and the latter's first bit becomes a spare one. */
static uint64_t word_at(const CtsBits *bits, int j, ptrdiff_t w)
{
    const ptrdiff_t at = j * (ptrdiff_t)bits->row_words + w;
    return (size_t)at < cts_bits_n_words(bits) ? bits->words[at] : 0;
}

/* Word w of row j shifted by one column: each bit is that of the column to the left (by -1) or to the right (by 1). */
static uint64_t shifted_by_column(const CtsBits *bits, int j, ptrdiff_t w, int by)
{
    const uint64_t own = word_at(bits, j, w), next = word_at(bits, j, w + by);
    return by < 0 ? own << 1 | next >> 63 : own >> 1 | next << 63;
}

/* Bits of word w of row j where the next voxel along the face is set. */
static uint64_t next_set(const CtsBits *bits, int axis, int way, int j, ptrdiff_t w)
{
    return axis ? word_at(bits, j + way, w) : shifted_by_column(bits, j, w, way);
}

/* The same where one of the two voxels beside the next one is set. */
static uint64_t beside_next_set(const CtsBits *bits, int axis, int way, int j, ptrdiff_t w)
{
    return axis ? shifted_by_column(bits, j + way, w, -1) | shifted_by_column(bits, j + way, w, 1)
                : shifted_by_column(bits, j - 1, w, way) | shifted_by_column(bits, j + 1, w, way);
}

/* The ends of plates in word w of row j that continue into other voxels. */
static uint64_t ends_of(const CtsBits *always, const CtsBits *plates, int axis, int way, int j, ptrdiff_t w)
{
    /* Most voxels have one of the plate next to them. */
    const uint64_t ends = cts_bits_row(plates, j, 0)[w] & ~next_set(plates, axis, way, j, w);
    return ends ? ends & ~beside_next_set(plates, axis, way, j, w) &
                      (next_set(always, axis, way, j, w) | beside_next_set(always, axis, way, j, w))
                : 0;
}

/* Starts from all ends of plates that continue into other voxels. */
static void add_from_ends(const CtsBits *always, const CtsBits *ever, CtsBits *plates, int axis, int way)
{
    for (int j = 0; j < plates->dims[1]; j++) {
        const uint64_t *const row = cts_bits_row(plates, j, 0);
        for (int w = 0; w < (int)plates->row_words; w++) {
            uint64_t ends = row[w] ? ends_of(always, plates, axis, way, j, w) : 0;
            for (; ends; ends &= ends - 1) {
                const int i = 64 * w + __builtin_ctzll(ends), along = axis ? j : i, across = axis ? i : j;
                for (int side = -1; side <= 1; side += 2) {
                    const Face f = {always, ever, plates, axis, side, way};
                    int at = across;
                    while (at != across + WAVER * side && get(&f, always, along, at + side))
                        at += side;
                    if (is_face(&f, along, at))
                        bridge(&f, along, at);
                }
            }
        }
    }
}

void cts_plate_contacts_add(const CtsBits *always, const CtsBits *ever, CtsBits *plates)
{
    for (int axis = 0; axis < 2; axis++)
        for (int way = -1; way <= 1; way += 2)
            add_from_ends(always, ever, plates, axis, way);
}
