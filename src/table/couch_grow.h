/* Table removal: how body and foreign parts grow towards each other in one slice, done only where it matters. */
#ifndef CTS_TABLE_COUCH_GROW_H
#define CTS_TABLE_COUCH_GROW_H

#include "table/couch_grid.h"

enum { COUCH_MAX_RIM = 32 };

/* Growth in steps of one voxel within the slice: a neighbouring slice at distance d joins in at step first_step[d],
 * late enough to make a ball. */
typedef struct CouchRim {
    int n_steps, n_slices;
    double reach_mm; /* no voxel further than this belongs to it */
    int first_step[COUCH_MAX_RIM + 1];
} CouchRim;

CouchRim couch_rim(const CouchScene *scene);

/* Masks as columns of words: word w of all rows of a slice, one row after the other, so that rows go side by side into
 * vectors and a part of a slice is a few long columns. Before the first row and behind the last one stands a 0. */
typedef struct CouchColumns {
    int n_words, n_rows, n_slices;
    size_t stride;
    uint64_t *words;
} CouchColumns;

/* All bits 0, of the rows of `like` and n_slices slices. Zero-initialised ones may be freed. */
CtsStatus couch_columns_new(CouchColumns *columns, const CtsBits *like, int n_slices, CtsError *err);
void couch_columns_free(CouchColumns *columns);
/* Rows first <= j < end of slice k as bits has them. */
void couch_columns_take(CouchColumns *columns, const CtsBits *bits, int k, int first, int end);

static inline uint64_t *couch_column(const CouchColumns *c, int w, int k)
{
    return c->words + ((size_t)k * (size_t)c->n_words + (size_t)w) * c->stride + 1;
}

/* Rows first <= j < end of column w. */
typedef struct CouchSpan {
    int w, first, end;
} CouchSpan;

typedef struct CouchSpans {
    CouchSpan *items;
    int n;
} CouchSpans;

/* One of the two shapes while it grows; where it has no span it stays as it was. */
typedef struct CouchSide {
    const CouchColumns *whole; /* of the volume, not grown */
    CouchSpans spans;
    CouchColumns grown, next; /* of one slice */
} CouchSide;

/* One thread's working memory. */
typedef struct CouchGrower {
    CouchSide body, foreign;
    uint64_t *zeros;    /* a column of them */
    uint64_t last_word; /* the bits of a row's last word that are voxels */
    uint8_t *in_use;
} CouchGrower;

CtsStatus couch_grower_new(CouchGrower *grower, const CouchGrid *grid, const CtsBits *like, const CouchColumns *body,
                           const CouchColumns *foreign, CtsError *err);
void couch_grower_free(CouchGrower *grower);

/* For the slices in layer ck of the grid: let the sides grow in these cells alone. */
void couch_grower_aim(CouchGrower *grower, const CouchGrid *grid, const CtsBits *body_cells,
                      const CtsBits *foreign_cells, int ck, const CtsBits *like);

/* Body and foreign grow by turns, each only over what the other does not hold; the body comes first. */
void couch_grow(CouchGrower *grower, const CouchRim *rim, int k);

/* A row of cells as a row of voxels of a mask like `like`. */
void couch_expand_cells(const CouchGrid *grid, const CtsBits *cells, int cj, int ck, const CtsBits *like,
                        uint64_t *row);

#endif
