/* A tile of the picture: its beams, and which of their packets are marched and which filled. */
#include "tiled/tile.h"

/* Beams are a packet wide and so high; tiles hold several, so that rows between find those around them. */
enum { BEAM_HEIGHT = 8, TILE_WIDTH = CTS_PACKET * TILED_BEAMS_ACROSS, TILE_HEIGHT = BEAM_HEIGHT * TILED_BEAMS_DOWN };
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
    return ((size_t)j->nk + 1) * (TILED_BEAMS_DOWN * TILED_BEAMS_ACROSS + 1);
}

static int smaller(int a, int b)
{
    return a < b ? a : b;
}

static int beam_y(const Tile *t, int down)
{
    return smaller(t->y0 + down * BEAM_HEIGHT, t->y1);
}

static TiledSpan span_at(const Tile *t, int across, int y)
{
    const int x = t->x0 + across * CTS_PACKET;
    return (TiledSpan){x, y, smaller(t->x1 - x, CTS_PACKET)};
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

/* Beams `down`: first as a single wide beam, which finds most of what is empty, then one by one, every row or those
 * that the others are filled from. */
static void march_beams(const Tile *t, int down)
{
    const TiledJob *j = t->job;
    TiledWorkspace *workspace = t->workspace;
    const size_t n_runs = (size_t)j->nk + 1;
    const int y0 = beam_y(t, down), y1 = beam_y(t, down + 1);
    TiledBeam wide = {.runs = workspace->runs + n_runs * TILED_BEAMS_DOWN * TILED_BEAMS_ACROSS};
    const bool any = y0 < y1 && cts_tiled_beam_init(j, &wide, t->x0, y0, t->x1, y1, 0);
    for (int across = 0; across < TILED_BEAMS_ACROSS; across++) {
        TiledBeam *beam = &workspace->beams[down][across];
        const int x = t->x0 + across * CTS_PACKET;
        beam->runs = workspace->runs + n_runs * (size_t)(down * TILED_BEAMS_ACROSS + across);
        bool *met = &workspace->met[down][across];
        *met = any && x < t->x1 && cts_tiled_beam_init(j, beam, x, y0, x + CTS_PACKET, y1, wide.first);
        TiledSpan spans[BEAM_HEIGHT];
        int n = 0;
        for (int y = y0; y < y1 && *met; y += 1 << j->fill_levels)
            spans[n++] = span_at(t, across, y);
        march_spans(t, beam, spans, n);
    }
}

/* Fills a packet from rows `away`, or says that it must be marched. */
static bool fill_span(const Tile *t, TiledBeam *beam, const TiledSpan *span, int away)
{
    const int above = span->y - t->y0, below = t->y1 - 1 - span->y;
    const TiledFill filled = cts_tiled_fill(t->job, span, away, above, below);
    t->workspace->counts.between++;
    if (filled == TILED_FILL_COLOUR) {
        /* The march is for the depth alone: the colours are the same, wanted or not. */
        t->path->single(t->job, beam, span, &t->workspace->counts);
        cts_tiled_fill(t->job, span, away, above, below);
    }
    t->workspace->counts.filled += filled != TILED_FILL_NONE;
    return filled != TILED_FILL_NONE;
}

/* Rows half way between those that are done, which are 2 `away` apart. */
static void fill_beams(const Tile *t, int down, int away)
{
    for (int across = 0; across < TILED_BEAMS_ACROSS; across++) {
        if (!t->workspace->met[down][across])
            continue;
        TiledBeam *beam = &t->workspace->beams[down][across];
        TiledSpan spans[BEAM_HEIGHT];
        int n = 0;
        for (int y = beam_y(t, down) + away; y < beam_y(t, down + 1); y += 2 * away) {
            spans[n] = span_at(t, across, y);
            n += !fill_span(t, beam, &spans[n], away);
        }
        march_spans(t, beam, spans, n);
    }
}

void cts_tiled_run_tile(const TiledJob *j, const TiledPath *path, TiledWorkspace *workspace, int index)
{
    const int x0 = index % tiles_across(j) * TILE_WIDTH, y0 = j->first_row + index / tiles_across(j) * TILE_HEIGHT;
    const Tile t = {
        j, path, workspace, x0, y0, smaller(x0 + TILE_WIDTH, j->width), smaller(y0 + TILE_HEIGHT, j->past_row)};
    for (int down = 0; down < TILED_BEAMS_DOWN; down++)
        march_beams(&t, down);
    for (int away = 1 << j->fill_levels >> 1; away > 0; away /= 2)
        for (int down = 0; down < TILED_BEAMS_DOWN; down++)
            fill_beams(&t, down, away);
}
