#include "render/error/error_control.h"

#include "base/clock.h"
#include "base/limits.h"
#include "base/mem.h"
#include "base/mutation.h"
#include "base/parallel.h"
#include "base/random.h"
#include "base/simd_fixed.h"
#include "render/engines/engines.h"
#include "render/error/marched_groups.h"
#include <math.h>
#include <stdio.h>
#include <string.h>

/* Rounding error of single precision, rms, without any other error. */
#define ROUNDING 1e-5

/* Indicators count by this share: errors are hardly ever more than half of the march's bounds. The indicators of sheets
 * are scaled with it to be so, too. */
#define WORTH 0.5
/* The floor f as a share of the requested error. Where indicators are estimates, which may be wrong anywhere, f^2 is
 * the sum of the requested error's square and the mean of b^2, so that half of a strip's sample is spread evenly. */
#define FLOOR_OF_BOUNDS 0.25
/* Terms as large as the largest that an estimate's limit assumes besides. At steps of opacity a few pixels have nearly
 * all of the error. */
#define ASSUMED 1.0
#define ASSUMED_AT_STEPS 9.0
/* Ratio e^2 / (b^2 + f^2), times the number of sampled pixels, of pixels that were not sampled, where all of these
 * happen to have no error. */
#define UNSAMPLED 32.0
/* Limit of a picture's error, by the requested one, from which a warning is due: more than equal in two digits. */
#define WARNED_FROM 1.005
/* Error of pixels that another engine's march re-renders, rms, as a share of the requested error: small beside it. */
#define RERENDERED 0.125

/* Likely error of the pixels of marched groups, rms, as a share of the requested error (0.1 to 0.2 measured on heads
 * and a chest). */
#define MARCHED_ERROR 0.25
/* Share of the requested squared error that the limit for groups that are not marched may have, in each round by this
 * factor less. The threshold is chosen for the samples that estimate them, so that the estimate is too low. */
#define UNMARCHED_SHARE 0.9

/* Bound of the relative error of Squares.sum: a term is a product, and at most 15 additions lead to the sum, each
 * rounded by 2^-24 at most. */
#define ROUGH 1e-6

/* A probability, divided by b^2 + f^2, at which every pixel is re-rendered. */
#define CERTAIN 1e30

enum {
    /* Of so many pixels one is re-rendered to estimate the error; more of a small picture. The 512 of 512 x 512 pixels
     * add ln 1000 / 512 of f^2 to the limit (cts_terms_limit()), a ninth of f. */
    ONE_IN = 512,
    /* Pixels re-rendered of a strip where ONE_IN would be more. Of 1024 x 1024 pixels a half takes 1.0 of the time,
     * with limits of 8/255 requested that are up to 1.7 times as large, twice as many 1.05 (30 views of five series).
     */
    IN_STRIP = 1024,
    AT_FIRST = 512, /* of so many pixels of a strip at most one is re-rendered in the first round, */
    AT_LAST = 12,   /* and in all rounds */
    ROUNDS = 4,     /* at most; beyond them whole strips are re-rendered where the caller allows it */
    /* Factor of the probability from round to round: from ONE_IN to about AT_LAST in two rounds (512 / 36 = 14). It
     * hardly matters: with 3 and 12, 24 pictures of 512 x 512 pixels of four series take 1.0 of the time, single ones
     * 0.7 to 1.6. */
    GROWTH = 6,
    /* Pixels for each that is re-rendered in a prediction. It and AT_LAST hardly matter, either: with a half, twice
     * and four times both, the 24 pictures take 0.99 to 1.01 of the time, single ones with four times up to 1.4. */
    PREDICTED = 2 * AT_LAST,
    /* Rays of marched groups that cost as much as one drawn ray, whose voxels are hardly ever in the cache: 4 to 7 on a
     * chest. */
    SAMPLE_COST = 4,
    SMALL = 1024, /* so many pixels of a picture may be re-rendered in any case */
};

/* Pixels that share a random number where their probabilities sum to 1 at most: one of them is drawn, or none.
 * Chernoff's bound holds as for independent draws: the expectation of the product of e^-tx over them is 1 + the sum of
 * a, at most the product of 1 + a, with a = p (e^-tx - 1) of each, between -1 and 0. */
enum { DRAWN_TOGETHER = 16 };

/* Sums over those of DRAWN_TOGETHER pixels that may be sampled. */
typedef struct Squares {
    float sum; /* of b^2 */
    float n;   /* number of pixels */
} Squares;

/* Rows of a strip that one thread counts. */
typedef struct Piece {
    double sum; /* of b^2, over pixels that may be sampled */
    size_t n_interpolated;
    size_t n_visible; /* pixels rendered and not empty; counted where there are interpolated ones */
} Piece;

/* A round's draw of pixels: probability of one to be drawn, divided by b^2 + f^2, and f^2. */
typedef struct Draw {
    double probability, floor;
} Draw;

/* A re-rendered pixel of the engine's own. It stands for those that were as likely to be drawn in any round, until its
 * group is marched. */
typedef struct Drawn {
    uint32_t place;
    double bound, square; /* b^2; e^2 */
} Drawn;

/* State of one strip. */
typedef struct Strip {
    size_t first, end;    /* its pixels */
    bool open;            /* takes part in this round */
    bool missed;          /* its error may be larger than requested */
    double floor;         /* f^2 */
    double probability;   /* probability of a pixel to be re-rendered, divided by b^2 + f^2 */
    size_t first_sampled; /* of this round's pixels, in Round.place */
    size_t n_sampled;     /* this round's pixels */
    size_t n_rerendered;  /* pixels re-rendered in all rounds */
    float marched_from;   /* groups with a larger indicator are marched before the next round; INFINITY: none */
    float last_from;      /* the last such indicator, INFINITY at first */
    bool marched;         /* groups have been marched since the last round */
    Draw draws[ROUNDS + 1];
    int n_draws;
    Drawn *drawn; /* in all rounds, of engines whose indicators are estimates */
    size_t n_drawn;
    CtsGroupSample *samples; /* of this round and those; NULL where groups are not marched */
    size_t n_samples;
    size_t n_interpolated;
    double share; /* pixels with the error of one: a rendered pixel's error is in those interpolated from it, too */
    CtsTerms terms;
    double excess, largest; /* as in CtsErrorControl */
} Strip;

typedef struct Round {
    const CtsErrorControl *control;
    CtsPicture *band;
    CtsErrorMap *errors;
    double error;     /* requested of re-rendered pixels, rms; 0: reference precision */
    double small;     /* share of a small picture that may be re-rendered in any case */
    double one_in;    /* one pixel of so many is re-rendered where the indicators equal the requested error */
    Squares *squares; /* of this round, for each DRAWN_TOGETHER pixels of the band */
    Piece *pieces;    /* of CTS_BAND_ROWS rows each */
    Strip *strips;
    size_t n_strips;
    int number;
    size_t n_sampled;
    uint32_t *place; /* room for all pixels: those that are re-rendered in this round, strip by strip; while they are
                        drawn, from the number of each strip's first pixel on */
    float (*rgba)[4], *off; /* their values, and the exact march's error bounds; then what they were off by */
    size_t n_marched;
} Round;

static bool has_bounds(const CtsErrorControl *c)
{
    return c->engine->indicator == CTS_INDICATOR_BOUND;
}

/* Limits of a strip's terms: of estimates where its sampled pixels have no error; of bounds, which errors exceed by so
 * much, the only one: where few pixels have all of the error, samples show too little of it. */
static CtsTermRange term_range(const CtsErrorControl *c, const Strip *s)
{
    double chance = 0; /* of a pixel without indicator in all draws, if it is small, by the last floor */
    for (int i = 0; i < s->n_draws; i++)
        chance += s->draws[i].probability * s->draws[i].floor / s->floor;
    const double each = s->share / chance, bound = each * fmax(s->excess, 1);
    return (CtsTermRange){c->has_opacity_step ? ASSUMED_AT_STEPS : ASSUMED,
                          has_bounds(c) ? bound : each * UNSAMPLED / fmax((double)s->n_rerendered, UNSAMPLED),
                          has_bounds(c) ? bound : INFINITY};
}

/* Error of re-rendered pixels, rms; 0: they are at reference precision, as a small picture's and a stiff preset's are.
 * Errors are measured against them, so that the limit of the true error is larger by this (triangle inequality). */
static double error_of_march(const CtsErrorControl *c)
{
    const double pixels = (double)c->scene.view.width * c->scene.view.height;
    return c->march == c->engine || c->has_opacity_step || pixels <= SMALL
               ? 0
               : RERENDERED * cts_scene_requested_error(&c->scene);
}

/* Share of that error which counts in limits: all of it, or twice what few pixels of the probe showed, but a quarter in
 * any case. Where the errors of sheets are independent of the march's, measured differences hold both. */
static double counted_error_of_march(const CtsErrorControl *c)
{
    const double requested = error_of_march(c);
    return c->march_error > 0 ? fmin(fmax(2 * c->march_error, requested / 4), requested) : requested;
}

/* Limit of the picture's error from which a warning is due. */
static double warned_from(const CtsScene *scene)
{
    return WARNED_FROM * cts_scene_requested_error(scene);
}

/* True of a pixel that may be sampled. */
static bool is_open(const CtsErrorMap *errors, size_t at)
{
    return errors->origin[at] == CTS_PIXEL_RENDERED || errors->origin[at] == CTS_PIXEL_MARCHED;
}

/* b^2 + f^2; 0: the pixel is not sampled. */
static double square_at(const Round *r, const Strip *s, size_t at)
{
    const double indicator = WORTH * (double)r->errors->indicator[at];
    return is_open(r->errors, at) ? indicator * indicator + s->floor : 0;
}

static double at_most_1(double p)
{
    return p < 1 ? p : 1;
}

static double probability_at(const Round *r, const Strip *s, size_t at)
{
    return at_most_1(s->probability * square_at(r, s, at));
}

static float sum_of_eight(f32x8 v)
{
    const f32x4 w = SHUFFLE(v, v, 0, 1, 2, 3) + SHUFFLE(v, v, 4, 5, 6, 7);
    return (w[0] + w[1]) + (w[2] + w[3]);
}

/* Squares of DRAWN_TOGETHER pixels from `first` on. */
static Squares sum_squares(const CtsErrorMap *errors, size_t first)
{
    _Static_assert(CTS_PIXEL_RENDERED % 2 == 0 && CTS_PIXEL_INTERPOLATED % 2 == 1 && CTS_PIXEL_MARCHED % 2 == 0 &&
                       CTS_PIXEL_REFERENCE % 2 == 1,
                   "pixels of odd origin are not sampled");
    f32x8 sum = {0};
    i32x8 n_odd = {0};
    uint64_t origin[DRAWN_TOGETHER / 8];
    memcpy(origin, errors->origin + first, sizeof origin);
    if (!((origin[0] | origin[1]) & UINT64_C(0x0101010101010101))) { /* none is odd, as in most */
        for (size_t at = first; at < first + DRAWN_TOGETHER; at += 8) {
            const f32x8 b = (float)WORTH * *(const f32x8 *)(errors->indicator + at);
            sum += b * b;
        }
        return (Squares){sum_of_eight(sum), DRAWN_TOGETHER};
    }
    for (size_t at = first; at < first + DRAWN_TOGETHER; at += 8) {
        const f32x8 b = (float)WORTH * *(const f32x8 *)(errors->indicator + at);
        const i32x8 odd = CONVERT(*(const u8x8 *)(errors->origin + at), i32x8) & 1;
        sum += (f32x8)((i32x8)(b * b) & (odd - 1));
        n_odd += odd;
    }
    return (Squares){sum_of_eight(sum), DRAWN_TOGETHER - sum_of_eight(CONVERT(n_odd, f32x8))};
}

/* Squares of the pixels from `first` to end - 1, up to DRAWN_TOGETHER. */
static Squares sum_some_squares(const CtsErrorMap *errors, size_t first, size_t end)
{
    Squares squares = {0};
    if (end - first >= DRAWN_TOGETHER)
        return sum_squares(errors, first);
    for (size_t i = first; i < end; i++) {
        const float b = (float)WORTH * errors->indicator[i];
        squares.sum += is_open(errors, i) ? b * b : 0;
        squares.n += is_open(errors, i);
    }
    return squares;
}

static void count_interpolated(const Round *r, size_t first, size_t end, Piece *piece)
{
    const uint8_t *const origin = r->errors->origin;
    if (!memchr(origin + first, CTS_PIXEL_INTERPOLATED, end - first))
        return;
    for (size_t i = first; i < end; i++) {
        piece->n_interpolated += origin[i] == CTS_PIXEL_INTERPOLATED;
        piece->n_visible += origin[i] != CTS_PIXEL_INTERPOLATED && r->band->pixels[4 * i + 3] > 0;
    }
}

/* r->squares and r->pieces. */
static void count_pieces(void *context, int worker, size_t first, size_t end)
{
    const Round *const r = context;
    const size_t n = (size_t)r->band->width * CTS_BAND_ROWS, all = (size_t)r->band->width * (size_t)r->band->height;
    (void)worker;
    for (size_t piece = first; piece < end; piece++) {
        const size_t last = (piece + 1) * n < all ? (piece + 1) * n : all;
        Piece counted = {0};
        for (size_t i = piece * n; i < last; i += DRAWN_TOGETHER) {
            const Squares squares = r->squares[i / DRAWN_TOGETHER] = sum_some_squares(r->errors, i, last);
            counted.sum += (double)squares.sum;
        }
        if (r->number == 0)
            count_interpolated(r, piece * n, last, &counted);
        r->pieces[piece] = counted;
    }
}

static Piece sum_pieces(const Round *r, const Strip *s)
{
    const size_t n = (size_t)r->band->width * CTS_BAND_ROWS;
    Piece sum = {0};
    for (size_t i = s->first / n; i * n < s->end; i++) {
        sum.sum += r->pieces[i].sum;
        sum.n_interpolated += r->pieces[i].n_interpolated;
        sum.n_visible += r->pieces[i].n_visible;
    }
    return sum;
}

/* Sum of the probabilities of up to DRAWN_TOGETHER pixels from `first` on, not limited to 1 each, with a relative error
 * of at most ROUGH. */
static double rough_probability(const Round *r, const Strip *s, size_t first)
{
    const Squares squares = r->squares[first / DRAWN_TOGETHER];
    return s->probability * ((double)squares.sum + (double)squares.n * s->floor);
}

/* A number that is uniform over 0 to 1, another for each pixel of the view and each round. */
static double uniform_at(const Round *r, size_t at)
{
    const uint64_t place = (uint64_t)r->band->first_row * (uint64_t)r->band->width + at;
    return (double)(cts_random_bits(place + ((uint64_t)r->number << 60) + 1) >> 11) * 0x1p-53;
}

/* Probabilities of up to DRAWN_TOGETHER pixels from `first` on, and their sum. */
static double find_probabilities(const Round *r, const Strip *s, size_t first, double probability[DRAWN_TOGETHER])
{
    double sum = 0;
    for (size_t i = 0; i < DRAWN_TOGETHER && first + i < s->end; i++)
        sum += probability[i] = probability_at(r, s, first + i);
    return sum;
}

/* Expected number of pixels that are drawn. */
static double count_expected(const Round *r, const Strip *s)
{
    double n = 0, probability[DRAWN_TOGETHER];
    for (size_t first = s->first; first < s->end; first += DRAWN_TOGETHER) {
        const double rough = rough_probability(r, s, first);
        n += rough < 1 ? rough : find_probabilities(r, s, first, probability);
    }
    return n;
}

/* Draw pixels. Most random numbers exceed the sum of their pixels' probabilities by more than its rounding error; the
 * others select a pixel by the probabilities of the estimate. */
static void draw(const Round *r, Strip *s)
{
    for (size_t first = s->first; first < s->end; first += DRAWN_TOGETHER) {
        const double rough = rough_probability(r, s, first), number = uniform_at(r, first);
        double probability[DRAWN_TOGETHER], until = 0;
        if (rough < 1 && number >= (1 + ROUGH) * rough)
            continue;
        const bool alone = find_probabilities(r, s, first, probability) > 1;
        for (size_t i = 0; i < DRAWN_TOGETHER && first + i < s->end; i++) {
            until = alone ? probability[i] : until + probability[i];
            if ((alone ? uniform_at(r, first + i) : number) >= until)
                continue;
            r->place[s->first + s->n_sampled++] = (uint32_t)(first + i);
            if (!alone)
                break;
        }
    }
}

/* Choose the pixels of a strip that are re-rendered: as many as the requested error needs; few where the strip is good,
 * and where it is so bad that more would not change the estimate. */
static void sample_strip(const Round *r, Strip *s)
{
    const double requested = cts_scene_requested_error(&r->control->scene), n = (double)(s->end - s->first);
    const bool first = r->number == 0 || s->marched;
    double most = n * at_most_1(r->small + 1.0 / (first ? AT_FIRST : AT_LAST));
    const Piece all = sum_pieces(r, s);
    if (r->number == 0) {
        s->n_interpolated = all.n_interpolated;
        s->share = all.n_visible > 0 ? 1 + (double)all.n_interpolated / (double)all.n_visible : 1;
    }
    if (first) {
        s->excess = 0;
        s->floor = has_bounds(r->control) ? FLOOR_OF_BOUNDS * FLOOR_OF_BOUNDS * requested * requested
                                          : requested * requested + all.sum / n;
    }
    s->probability = first ? 1 / (r->one_in * requested * requested) : GROWTH * s->probability;
    if (r->number == ROUNDS) {
        s->probability = CERTAIN;
        most = INFINITY;
    }
    const double expected = count_expected(r, s);
    s->probability *= expected > most ? most / expected : 1;
    s->n_draws = has_bounds(r->control) ? 0 : s->n_draws;
    s->draws[s->n_draws++] = (Draw){s->probability, s->floor};
    draw(r, s);
}

static void sample_some(void *context, int worker, size_t first, size_t end)
{
    const Round *const r = context;
    (void)worker;
    for (size_t strip = first; strip < end; strip++) {
        Strip *const s = &r->strips[strip];
        s->n_sampled = 0;
        if (s->open)
            sample_strip(r, s);
    }
}

/* True where a picture of strips with these terms would meet `share` of the squared requested error, without a
 * warning. */
static bool is_met(const Round *r, const Strip *s, const CtsTerms *terms, double share)
{
    const CtsErrorControl *const c = r->control;
    const double warned = fmax(warned_from(&c->scene) - ROUNDING, 0); /* which the reported limit has, too */
    const double pixels = (double)c->scene.view.width * c->scene.view.height, n = (double)(s->end - s->first),
                 march = counted_error_of_march(c);
    const CtsTerms all = {terms->sum * pixels / n, terms->squares * pixels / n, terms->largest};
    return cts_terms_limit(&all, term_range(c, s), pixels) <= share * warned * warned - march * march;
}

/* Part of a strip that rounds may re-render. */
static bool has_more(const Round *r, const Strip *s)
{
    return (double)s->n_rerendered < (double)(s->end - s->first) * fmin(r->small + 1.0 / AT_LAST, 1);
}

/* Largest indicator of the group that a pixel lies in. */
static float group_at(const Round *r, const Strip *s, size_t at)
{
    const int width = r->band->width, x = (int)(at % (size_t)width), y = (int)(at / (size_t)width);
    return cts_group_indicator(r->errors->indicator, r->errors->origin, width, (int)(s->end / (size_t)width),
                               x / CTS_GROUP_SIDE * CTS_GROUP_SIDE, y / CTS_GROUP_SIDE * CTS_GROUP_SIDE);
}

typedef struct StripOfRound {
    const Round *round;
    const Strip *strip;
} StripOfRound;

static bool would_meet(void *context, const CtsTerms *terms)
{
    const StripOfRound *const c = context;
    return is_met(c->round, c->strip, terms, pow(UNMARCHED_SHARE, c->round->number + 1));
}

/* Chooses the groups of a missed strip to be marched. */
static bool choose_groups(const Round *r, Strip *s)
{
    StripOfRound context = {r, s};
    if (!s->samples || s->last_from == 0)
        return false;
    const float from = cts_group_threshold(s->samples, s->n_samples, would_meet, &context);
    s->marched_from = from < s->last_from ? from : s->last_from / 2;
    return true;
}

/* Chance of a pixel of the engine's own to have been drawn in any of the rounds. */
static double chance_of(const Strip *s, double bound)
{
    double rest = 1;
    for (int i = 0; i < s->n_draws; i++)
        rest *= 1 - at_most_1(s->draws[i].probability * (bound + s->draws[i].floor));
    return 1 - rest;
}

/* Adds a pixel's term to the estimate: its error is replaced, but not where others are interpolated from it. group:
 * largest indicator of its group; 0: it is marched already. */
static void add_term(Strip *s, double square, double p, float group)
{
    const double term = square * (s->share - p) / p;
    cts_terms_add_one(&s->terms, term);
    if (s->samples)
        s->samples[s->n_samples++] = (CtsGroupSample){group, {term, term * term, term}};
}

static bool group_is_marched(const Round *r, const Strip *s, size_t at)
{
    const size_t width = (size_t)r->band->width, x = at % width / CTS_GROUP_SIDE * CTS_GROUP_SIDE,
                 n = width - x < CTS_GROUP_SIDE ? width - x : CTS_GROUP_SIDE;
    bool marched = false;
    size_t first = at / width / CTS_GROUP_SIDE * CTS_GROUP_SIDE * width + x;
    for (int j = 0; j < CTS_GROUP_SIDE && first < s->end; j++, first += width)
        marched |= memchr(r->errors->origin + first, CTS_PIXEL_MARCHED, n) != NULL;
    return marched;
}

/* Pixels drawn in earlier rounds, but those of groups marched since. */
static void add_drawn(const Round *r, Strip *s)
{
    size_t n = 0;
    for (size_t i = 0; i < s->n_drawn; i++) {
        const Drawn d = s->drawn[i];
        if (group_is_marched(r, s, d.place))
            continue;
        s->drawn[n++] = d;
        add_term(s, d.square, chance_of(s, d.bound), group_at(r, s, d.place));
    }
    s->n_drawn = n;
}

/* The errors of this round's pixels. */
static void add_sampled(const Round *r, Strip *s)
{
    for (size_t i = s->first_sampled; i < s->first_sampled + s->n_sampled; i++) {
        const size_t at = r->place[i];
        const bool own = r->errors->origin[at] == CTS_PIXEL_RENDERED && !has_bounds(r->control);
        float *const pixel = r->band->pixels + 4 * at;
        const double off = r->error > 0 ? 0 : WORTH * (double)r->off[i],
                     error = sqrt(cts_scene_square_of_error(&r->control->scene, pixel, r->rgba[i])) + off,
                     square = error * error, bound = square_at(r, s, at) - s->floor,
                     p = own ? chance_of(s, bound) : probability_at(r, s, at);
        add_term(s, square, p, own ? group_at(r, s, at) : 0);
        s->terms.sum += off * off;
        if (own)
            s->drawn[s->n_drawn++] = (Drawn){r->place[i], bound, square};
        if (p < 1)
            s->excess = fmax(s->excess, square / square_at(r, s, at));
        if (!CTS_MUTATED(UNCAST))
            memcpy(pixel, r->rgba[i], sizeof r->rgba[i]);
        r->off[i] = (float)error;
    }
}

/* Estimate the strips' errors from the re-rendered pixels, and replace these. */
static void estimate_some(void *context, int worker, size_t first, size_t end)
{
    const Round *const r = context;
    (void)worker;
    for (size_t strip = first; strip < end; strip++) {
        Strip *const s = &r->strips[strip];
        if (!s->open)
            continue;
        s->terms = (CtsTerms){0};
        s->n_samples = 0;
        add_drawn(r, s);
        add_sampled(r, s);
        s->n_rerendered += s->n_sampled;
        s->missed = !is_met(r, s, &s->terms, 1);
        s->open = s->missed && (choose_groups(r, s) || has_more(r, s));
        for (size_t i = s->first_sampled; i < s->first_sampled + s->n_sampled; i++) {
            r->errors->origin[r->place[i]] = CTS_PIXEL_REFERENCE;
            r->errors->indicator[r->place[i]] = 0;
            if (!has_bounds(r->control))
                cts_expect_error_beside(r->band, r->errors, r->place[i], r->off[i]);
        }
    }
}

/* True where another round of samples costs less than the march of n pixels, which level hybrid counts on, and would
 * do if its errors were as large in the mean: a few large terms make the limit too large, not the error itself. */
static bool samples_instead(const Round *r, const Strip *s, size_t n)
{
    const CtsTerms next = {s->terms.sum, s->terms.squares / GROWTH, s->terms.largest / GROWTH};
    return r->control->scene.plan.level != CTS_LEVEL_HYBRID && r->number + 1 < ROUNDS && has_more(r, s) &&
           n > SAMPLE_COST * GROWTH * s->n_sampled && is_met(r, s, &next, 1);
}

/* Marches the groups that the last round chose, of all strips but those that are sampled instead. */
static CtsStatus march_groups(Round *r, CtsError *err)
{
    CtsStatus st = CTS_OK;
    const size_t width = (size_t)r->band->width;
    uint32_t *place = NULL;
    size_t n = 0;
    for (size_t i = 0; i < r->n_strips && !st; i++) {
        Strip *const s = &r->strips[i];
        s->marched = s->open && s->marched_from < INFINITY;
        if (s->marched && (place || !(st = cts_alloc_array(&place, (size_t)r->band->height * width, err)))) {
            const size_t listed = cts_list_groups(r->band, r->errors, (int)(s->first / width), (int)(s->end / width),
                                                  s->marched_from, place, n);
            s->marched = !samples_instead(r, s, listed - n);
            n = s->marched ? listed : n;
            s->last_from = s->marched ? s->marched_from : s->last_from;
        }
        s->marched_from = INFINITY;
    }
    CtsScene scene = r->control->scene;
    scene.plan.few_rays = false; /* groups are up to half of the picture */
    if (n > 0)
        st = cts_march_groups(r->control->march, &scene, place, n, r->band, r->errors, err);
    r->n_marched += n;
    cts_free(&place);
    return st;
}

/* Renders this round's pixels again at reference precision where the march's own error may be more than the requested
 * one: at a grazing contact the march in single precision may miss what a sheet has found. */
static CtsStatus rerender_doubtful(Round *r, CtsError *err)
{
    const CtsErrorControl *const c = r->control;
    const double largest_off = cts_scene_requested_error(&c->scene) / WORTH;
    CtsStatus st;
    uint32_t *place = NULL;
    size_t n = 0;
    float(*rgba)[4] = NULL, *off = NULL;
    if ((st = cts_alloc_array(&place, r->n_sampled, err)) || (st = cts_alloc_array(&rgba, r->n_sampled, err)) ||
        (st = cts_alloc_array(&off, r->n_sampled, err)))
        goto end;
    for (size_t i = 0; i < r->n_sampled; i++)
        if ((double)r->off[i] > largest_off)
            place[n++] = r->place[i];
    if (n == 0 || (st = c->march->render_pixels(&c->scene, r->band, place, n, 0, rgba, off, err)))
        goto end;
    n = 0;
    for (size_t i = 0; i < r->n_sampled; i++)
        if ((double)r->off[i] > largest_off)
            memcpy(r->rgba[i], rgba[n++], sizeof r->rgba[i]);
end:
    cts_free(&place);
    cts_free(&rgba);
    cts_free(&off);
    return st;
}

static CtsStatus run_round(Round *r, CtsError *err)
{
    const CtsErrorControl *const c = r->control;
    const int n_threads = c->scene.settings->n_threads;
    CtsStatus st;
    const size_t n_pieces = ((size_t)r->band->height + CTS_BAND_ROWS - 1) / CTS_BAND_ROWS;
    cts_parallel(n_threads, n_pieces, 1, count_pieces, r);
    cts_parallel(n_threads, r->n_strips, 1, sample_some, r);
    r->n_sampled = 0;
    for (size_t i = 0; i < r->n_strips; i++) {
        Strip *const s = &r->strips[i];
        memmove(r->place + r->n_sampled, r->place + s->first, s->n_sampled * sizeof *r->place);
        s->first_sampled = r->n_sampled;
        r->n_sampled += s->n_sampled;
        cts_free(&s->samples);
        st = s->drawn ? cts_resize_array(&s->drawn, s->n_drawn, s->n_drawn + s->n_sampled, err)
                      : cts_alloc_array(&s->drawn, s->n_sampled, err);
        if (st || (c->marches_groups && (st = cts_alloc_array(&s->samples, s->n_drawn + s->n_sampled, err))))
            return st;
    }
    cts_free(&r->rgba);
    cts_free(&r->off);
    if ((st = cts_alloc_array(&r->rgba, r->n_sampled, err)) || (st = cts_alloc_array(&r->off, r->n_sampled, err)))
        return st;
    if (r->n_sampled > 0 &&
        (st = c->march->render_pixels(&c->scene, r->band, r->place, r->n_sampled, r->error, r->rgba, r->off, err)))
        return st;
    if (r->error > 0 && (st = rerender_doubtful(r, err)))
        return st;
    cts_parallel(n_threads, r->n_strips, 1, estimate_some, r);
    return CTS_OK;
}

typedef struct Predicting {
    const CtsScene *scene;
    const CtsErrorPrediction *of;
    double pixels;
    double probability;
} Predicting;

/* Upper limit of a frame's error, rms, that has these terms. */
static double predicted_limit(const Predicting *p, const CtsTerms *terms)
{
    const double march = RERENDERED * cts_scene_requested_error(p->scene);
    const CtsTermRange range = {ASSUMED, UNSAMPLED / fmax((double)p->of->n, UNSAMPLED) / p->probability, INFINITY};
    return sqrt(march * march + cts_terms_limit(terms, range, p->pixels));
}

static bool predicts_enough(void *context, const CtsTerms *terms)
{
    const Predicting *const p = context;
    const double requested = cts_scene_requested_error(p->scene), marched = MARCHED_ERROR * requested;
    const CtsTerms all = {terms->sum + p->pixels * marched * marched, terms->squares, terms->largest};
    return predicted_limit(p, &all) <= requested;
}

CtsStatus cts_error_control_predict(const CtsScene *scene, CtsErrorPrediction *of, CtsError *err)
{
    const double requested = cts_scene_requested_error(scene), n = (double)of->n;
    const double pixels = (double)scene->view.width * scene->view.height;
    double squares = 0;
    CtsTerms all = {0};
    CtsGroupSample *samples = NULL;
    CtsStatus st = cts_alloc_array(&samples, of->n, err);
    if (st)
        return st;
    for (size_t i = 0; i < of->n; i++)
        squares += WORTH * WORTH * (double)of->indicator[i] * (double)of->indicator[i] / n;
    const double floor = requested * requested + squares;
    Predicting p = {scene, of, pixels, 1 / (PREDICTED * (squares + floor))};
    for (size_t i = 0; i < of->n; i++) {
        const double b = WORTH * (double)of->indicator[i], probability = fmin(p.probability * (b * b + floor), 1),
                     term = of->square[i] * (1 - probability) / probability, number = pixels / n * probability;
        /* as many terms as the pixels that this one stands for have */
        samples[i] = (CtsGroupSample){of->group ? of->group[i] : 0, {number * term, number * term * term, term}};
        cts_terms_add(&all, &samples[i].terms);
    }
    of->marched_from = INFINITY;
    of->limit = of->n > 0 ? predicted_limit(&p, &all) : 0;
    if (of->group && of->limit > requested) {
        of->marched_from = cts_group_threshold(samples, of->n, predicts_enough, &p);
        of->limit = requested;
    }
    cts_free(&samples);
    return CTS_OK;
}

static void find_some_largest(void *context, int worker, size_t first, size_t end)
{
    const Round *const r = context;
    (void)worker;
    for (size_t strip = first; strip < end; strip++) {
        Strip *const s = &r->strips[strip];
        for (size_t i = s->first; i < s->end; i++)
            if (r->errors->origin[i] == CTS_PIXEL_RENDERED)
                s->largest = fmax(s->largest, WORTH * (double)r->errors->indicator[i]);
    }
}

static bool any_open(const Round *r)
{
    for (size_t i = 0; i < r->n_strips; i++)
        if (r->strips[i].open)
            return true;
    return false;
}

CtsStatus cts_error_control_enforce(CtsErrorControl *control, CtsPicture *band, CtsErrorMap *errors, CtsError *err)
{
    const CtsScene *const scene = &control->scene;
    const double wall = cts_wall_ms(), cpu = cts_cpu_ms();
    const double pixels = (double)scene->view.width * scene->view.height;
    const size_t width = (size_t)band->width, n = width * (size_t)band->height;
    const size_t strip = width * (size_t)cts_strip_rows(band->width);
    Round r = {.control = control,
               .band = band,
               .errors = errors,
               .error = error_of_march(control),
               .n_strips = (n + strip - 1) / strip,
               .small = SMALL / pixels,
               .one_in = fmax(fmin(pixels / ONE_IN, fmax(ONE_IN, (double)strip / IN_STRIP)), 1)};
    CtsStatus st;
    if ((st = cts_alloc_zeroed(&r.strips, r.n_strips, err)) || (st = cts_alloc_array(&r.place, n, err)) ||
        (st = cts_alloc_array(&r.pieces, n / (width * CTS_BAND_ROWS) + 1, err)) ||
        (st = cts_alloc_array(&r.squares, (n + DRAWN_TOGETHER - 1) / DRAWN_TOGETHER, err)))
        goto end;
    for (size_t i = 0; i < r.n_strips; i++)
        r.strips[i] = (Strip){.first = i * strip,
                              .end = i + 1 < r.n_strips ? (i + 1) * strip : n,
                              .open = true,
                              .marched_from = INFINITY,
                              .last_from = INFINITY};
    for (; r.number < ROUNDS && any_open(&r); r.number++)
        if ((st = march_groups(&r, err)) || (st = run_round(&r, err)))
            goto end;
    r.number = ROUNDS;
    for (size_t i = 0; i < r.n_strips; i++)
        r.strips[i].open = control->whole_strips && r.strips[i].missed;
    if (any_open(&r) && (st = run_round(&r, err)))
        goto end;
    if (has_bounds(control))
        cts_parallel(scene->settings->n_threads, r.n_strips, 1, find_some_largest, &r);
    for (size_t i = 0; i < r.n_strips; i++) {
        const Strip *const s = &r.strips[i];
        cts_terms_add(&control->terms, &s->terms);
        const CtsTermRange range = term_range(control, s);
        control->range.assumed = range.assumed;
        control->range.least = fmax(control->range.least, range.least);
        control->range.most = fmax(control->range.most, range.most);
        control->excess = fmax(control->excess, s->excess);
        control->largest = fmax(control->largest, s->largest);
        control->n_rerendered += s->n_rerendered;
        control->n_interpolated += s->n_interpolated;
    }
    cts_terms_add(&control->interpolation, &errors->interpolation);
    control->n_pixels += n;
    control->n_marched += r.n_marched;
end:
    control->wall_ms += cts_wall_ms() - wall;
    control->cpu_ms += cts_cpu_ms() - cpu;
    for (size_t i = 0; r.strips && i < r.n_strips; i++) {
        cts_free(&r.strips[i].drawn);
        cts_free(&r.strips[i].samples);
    }
    cts_free(&r.squares);
    cts_free(&r.pieces);
    cts_free(&r.strips);
    cts_free(&r.place);
    cts_free(&r.rgba);
    cts_free(&r.off);
    return st;
}

double cts_error_control_rmse(const CtsErrorControl *c)
{
    const double march = counted_error_of_march(c);
    const CtsTermRange any = {ASSUMED, 0, INFINITY};
    return ROUNDING + sqrt(march * march + cts_terms_limit(&c->terms, c->range, (double)c->n_pixels) +
                           cts_terms_limit(&c->interpolation, any, (double)c->n_pixels));
}

/* Largest error of a pixel; negative where nothing bounds it. Re-rendered pixels show how far errors exceed the bounds,
 * floor included; one channel may have all of a pixel's error; and a pixel that was not sampled may err twice as much.
 */
static double largest_error(const CtsErrorControl *c)
{
    const double floor = FLOOR_OF_BOUNDS * cts_scene_requested_error(&c->scene);
    const double largest = 2 * sqrt(3 * fmax(c->excess, 1) * (c->largest * c->largest + floor * floor));
    return has_bounds(c) && c->n_interpolated == 0 ? fmin(largest / WORTH, 1) : -1;
}

void cts_error_control_report(const CtsErrorControl *c, CtsReport *report)
{
    if (!report || c->n_pixels == 0)
        return;
    const double rmse = cts_error_control_rmse(c) * (CTS_MUTATED(BOUND_LOW) ? 0.05 : 1),
                 requested = cts_scene_requested_error(&c->scene), largest = largest_error(c);
    CtsErrorBound *bound = &report->bound;
    /* The worst frame of a rotation represents all. */
    bound->max = (bound->known && bound->max < 0) || largest < 0 ? -1 : fmax(bound->max, largest);
    bound->known = true;
    bound->rmse = fmax(bound->rmse, rmse);
    bound->rms_estimate = fmax(bound->rms_estimate, sqrt((c->terms.sum + c->interpolation.sum) / (double)c->n_pixels));
    bound->n_rerendered += c->n_rerendered;
    snprintf(bound->engine, sizeof bound->engine, "%s", c->engine->name);
    if (c->engine->levels)
        snprintf(bound->level, sizeof bound->level, "%s", cts_engine_level_names[c->scene.plan.level]);
    cts_report_stage(report, CTS_STAGE_COMPOSITE, c->wall_ms, c->cpu_ms, c->n_rerendered, 0);
    cts_report_plan(report, "%llu of %llu pixels re-rendered %s, to estimate the error and to correct the worst",
                    (unsigned long long)c->n_rerendered, (unsigned long long)c->n_pixels,
                    c->march == c->engine ? "in double precision" : "by the exact march");
    if (c->n_marched > 0)
        cts_report_plan(report,
                        "%llu pixels rendered by the exact march, in groups of %d x %d with large error indicators",
                        (unsigned long long)c->n_marched, CTS_GROUP_SIDE, CTS_GROUP_SIDE);
    const bool kept = rmse <= warned_from(&c->scene), by_default = !(c->scene.plan.max_error > 0);
    char list[CTS_ENGINE_LIST_MAX];
    if (!kept || !by_default)
        cts_report_diagnostic(report, kept ? CTS_DIAGNOSTIC_MAX_ERROR : CTS_DIAGNOSTIC_ERROR_BOUND,
                              "the picture's error is at most about %.2g/255 rms, %s %.2g%s%s%s", 255 * rmse,
                              by_default ? "default target" : "requested", 255 * requested, kept ? "" : " (reference: ",
                              kept ? "" : cts_engines_with(offsetof(CtsEngine, is_reference), CTS_ENGINE_FLAG, list),
                              kept ? "" : ")");
}
