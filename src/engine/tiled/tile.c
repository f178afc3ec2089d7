/* A tile of the picture: its beams, and the march of their packets. */
#include "engine/tiled/tile.h"

#include "engine/tiled/lattice.h"

/* Beams are a packet wide and so high; tiles hold several, which a wider beam looks ahead for. */
enum { BEAM_HEIGHT = 8, TILE_WIDTH = 64, TILE_HEIGHT = 64 };
_Static_assert((int)CTS_DRAWN_PIXELS == (int)CTS_PACKET, "packets are drawn as a whole");
_Static_assert(CTS_BAND_ROWS % TILE_HEIGHT == 0, "a band of rows is whole tiles, or the picture would depend on it");

typedef struct Tile {
    const TiledJob *job;
    const TiledPath *path;
    TiledWorkspace *workspace;
    int x0, y0, x1, y1;
} Tile;

static int tiles_across(const TiledJob *j)
{
    return (j->width + TILE_WIDTH - 1) / TILE_WIDTH;
}

int cts_tiled_n_tiles(const TiledJob *j)
{
    return tiles_across(j) * ((j->past_row - j->first_row + TILE_HEIGHT - 1) / TILE_HEIGHT);
}

size_t cts_tiled_n_runs(const TiledJob *j)
{
    return 2 * ((size_t)j->nk + 1);
}

static int smaller(int a, int b)
{
    return a < b ? a : b;
}

static void march_spans(const Tile *t, TiledBeam *beam, const TiledSpan *spans, int n)
{
    const TiledPath *k = t->path;
    for (int i = 0; i < n; i += k->at_once)
        if (i + k->at_once <= n)
            k->packets(t->job, beam, spans + i, &t->workspace->counts);
        else
            k->single(t->job, beam, spans + i, &t->workspace->counts);
}

/* The packets of a beam from column x on that are to be marched; what a lattice tells is filled in. */
static int list_spans(const Tile *t, int x, int y0, int y1, TiledSpan spans[BEAM_HEIGHT])
{
    const TiledJob *j = t->job;
    const int n_pixels = smaller(t->x1 - x, CTS_PACKET);
    int n = 0;
    for (int y = y0; y < y1; y++) {
        if (j->lattice.rgba && y % 2 == 0 && cts_lattice_fill(j, x, y, n_pixels))
            y++;
        else if (cts_plan_draws(&j->plan, x, y))
            spans[n++] = (TiledSpan){x, y, n_pixels};
    }
    return n;
}

/* A row of beams: first as a single wide beam, which finds most of what is empty, then one by one. */
static void march_beams(const Tile *t, int y0)
{
    const TiledJob *j = t->job;
    const int y1 = smaller(y0 + BEAM_HEIGHT, t->y1);
    TiledBeam wide = {.runs = t->workspace->runs}, beam = {.runs = t->workspace->runs + j->nk + 1};
    if (!cts_tiled_beam_init(j, &wide, t->x0, y0, t->x1, y1, 0))
        return;
    for (int x = t->x0; x < t->x1; x += CTS_PACKET) {
        TiledSpan spans[BEAM_HEIGHT];
        const int n = list_spans(t, x, y0, y1, spans);
        if (n > 0 && cts_tiled_beam_init(j, &beam, x, y0, x + CTS_PACKET, y1, wide.first))
            march_spans(t, &beam, spans, n);
    }
}

void cts_tiled_run_tile(const TiledJob *j, const TiledPath *path, TiledWorkspace *workspace, int index)
{
    const int x0 = index % tiles_across(j) * TILE_WIDTH, y0 = j->first_row + index / tiles_across(j) * TILE_HEIGHT;
    const Tile t = {
        j, path, workspace, x0, y0, smaller(x0 + TILE_WIDTH, j->width), smaller(y0 + TILE_HEIGHT, j->past_row)};
    for (int y = t.y0; y < t.y1; y += BEAM_HEIGHT)
        march_beams(&t, y);
}
