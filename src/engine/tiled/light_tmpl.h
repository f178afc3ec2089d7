/* Lighting, part of march_tmpl.h: how slopes shine, and when slabs are lit. */
#include "engine/tiled/doubt_tmpl.h"

enum { TURN_POINTS = 6 };

/* Relative error below 5e-6; 0 has a large one, and no more. */
INLINE vf inverse_sqrt(vf x)
{
    const vf half = 0.5f * x;
    vf y = (vf)(0x5f375a86 - ((vi)x >> 1));
    y *= 1.5f - half * y * y;
    return y * (1.5f - half * y * y);
}

/* The specular part for n values of |n.v|. */
INLINE void specular_powers(const CtsShade *shade, const vf *facing, vf *power, int n)
{
    vf square[TURN_POINTS];
    if (shade->whole_power == 0) {
        for (int i = 0; i < n; i++)
            power[i] = select_f(vf_lt(vf_of(0), facing[i]), shade_power(shade, facing[i]), vf_of(0));
        return;
    }
    for (int i = 0; i < n; i++) {
        square[i] = vf_max(facing[i], vf_of(shade->least_power));
        power[i] = vf_of(1);
    }
    for (int bits = shade->whole_power;;) {
        for (int i = 0; i < n && bits & 1; i++)
            power[i] *= square[i];
        bits >>= 1;
        if (bits == 0)
            return;
        for (int i = 0; i < n; i++)
            square[i] *= square[i];
    }
}

/* A gradient on its way through a stretch, start + (rise + bend f) f: it is mixed, as it is between voxels, and only
 * then made a direction, so that the weak gradient of air does not turn that of a surface. */
typedef struct Turn {
    Slope start, rise, bend;
} Turn;

INLINE vf dot(const Slope *a, const Slope *b)
{
    return a->right * b->right + a->up * b->up + a->along * b->along;
}

INLINE Slope less(const Slope *a, const Slope *b)
{
    return (Slope){a->right - b->right, a->up - b->up, a->along - b->along};
}

INLINE vf facing_at(const Turn *t, bool bent, vf f)
{
    Slope g = t->rise;
    if (bent)
        g = (Slope){g.right + t->bend.right * f, g.up + t->bend.up * f, g.along + t->bend.along * f};
    g = (Slope){t->start.right + g.right * f, t->start.up + g.up * f, t->start.along + g.along * f};
    const vf size = CTS_MUTATED(ONE_SIDED_LIGHT) ? vf_max(g.along, vf_of(0)) : vf_abs(g.along);
    return vf_min(size * inverse_sqrt(vf_max(dot(&g, &g), vf_of(1e-30f))), vf_of(1));
}

/* The means of |n.v| and its specular part over as much of the way as has its middle at f, in lanes in `turning`. A
 * gradient that turns round passes through all directions in between, most of them where it is smallest: points stand
 * closer there, by the square of their number, on either side. */
INLINE void mean_of_turn(const CtsShade *shade, const Turn *turn, bool bent, vf f, vmask turning, vf *facing, vf *power)
{
    const vf from = vf_max(2 * f - 1, vf_of(0)), to = vf_min(2 * f, vf_of(1));
    Slope whole = turn->rise;
    if (bent)
        whole = (Slope){whole.right + turn->bend.right, whole.up + turn->bend.up, whole.along + turn->bend.along};
    const vf smallest = -dot(&turn->start, &whole) / vf_max(dot(&whole, &whole), vf_of(1e-30f));
    const vf mid = vf_min(vf_max(smallest, from), to);
    const vf front = mid - from, back = to - mid, share = 1.0f / vf_max(to - from, vf_of(1e-6f));
    vf facings[TURN_POINTS], powers[TURN_POINTS], sum = vf_of(0), power_sum = vf_of(0);
    for (int i = 0; i < TURN_POINTS / 2; i++) {
        const float t = (2 * (float)i + 1) / TURN_POINTS;
        facings[2 * i] = facing_at(turn, bent, mid - front * (t * t));
        facings[2 * i + 1] = facing_at(turn, bent, mid + back * (t * t));
    }
    specular_powers(shade, facings, powers, TURN_POINTS);
    for (int i = 0; i < TURN_POINTS / 2; i++) {
        const float weight = 4 * (2 * (float)i + 1) / (TURN_POINTS * TURN_POINTS);
        sum += weight * (front * facings[2 * i] + back * facings[2 * i + 1]);
        power_sum += weight * (front * powers[2 * i] + back * powers[2 * i + 1]);
    }
    *facing = select_f(turning, vf_min(sum * share, vf_of(1)), *facing);
    *power = select_f(turning, vf_min(power_sum * share, vf_of(1)), *power);
}

OUTLINE void mean_of_straight_turn(const CtsShade *shade, const Turn *turn, vf f, vmask turning, vf *facing, vf *power)
{
    mean_of_turn(shade, turn, false, f, turning, facing, power);
}

OUTLINE void mean_of_bent_turn(const CtsShade *shade, const Turn *turn, vf f, vmask turning, vf *facing, vf *power)
{
    mean_of_turn(shade, turn, true, f, turning, facing, power);
}

/* What colour is multiplied with, and the white added to it. */
typedef struct Glow {
    vf colour, white;
} Glow;

/* What a lit march has: the colours in Light are due, they wait for their lighting until they are worth a slope. */
typedef struct Lit {
    vf r, g, b;
    vf due;       /* the opacity that goes with the colours that are due */
    Glow glow;    /* the last */
    unsigned had; /* packets that have had one, a bit each */
    vi last;      /* the sheet before the last stretch that took light */
} Lit;

/* A colour, and what has been gathered, as they show by the last lighting there was. */
INLINE void show_lit(const Lit *lit, Colour *c, Colour *sum)
{
    const vf glow = lit->glow.colour, white = lit->glow.white, due = lit->due * white;
    *c = (Colour){vf_fma(c->r, glow, white), vf_fma(c->g, glow, white), vf_fma(c->b, glow, white)};
    *sum = (Colour){vf_fma(sum->r, glow, lit->r + due), vf_fma(sum->g, glow, lit->g + due),
                    vf_fma(sum->b, glow, lit->b + due)};
}

/* What a march carries from stretch to stretch. */
typedef struct Course {
    Slope slope;
    int slope_sheet; /* that slope belongs to, as q * samples + part */
    bool timed;
    uint64_t ticks; /* spent on lighting, where timed */
} Course;

/* Beginnings, member by member: zeroing all of them costs more than a short march. */
INLINE Lit no_light(void)
{
    Lit lit;
    lit.r = lit.g = lit.b = lit.due = lit.glow.colour = lit.glow.white = vf_of(0);
    lit.had = 0;
    lit.last = vi_of(0);
    return lit;
}

INLINE Course start_course(bool timed)
{
    Course course;
    course.slope.right = course.slope.up = course.slope.along = vf_of(0);
    course.slope_sheet = -1;
    course.timed = timed;
    course.ticks = 0;
    return course;
}

/* In lanes in `bent`, the bend of the parabola through the slope on a sheet half way. */
OUTLINE Slope find_slope_bend(const TiledJob *j, const Packet *pk, Way way, int q, int part, bool inner, vmask bent,
                              const Slope *from, const Slope *to)
{
    const Slope mid = slope_at(j, pk, way, q, part, inner);
    return (Slope){select_f(bent, 2 * (from->right + to->right) - 4 * mid.right, vf_of(0)),
                   select_f(bent, 2 * (from->up + to->up) - 4 * mid.up, vf_of(0)),
                   select_f(bent, 2 * (from->along + to->along) - 4 * mid.along, vf_of(0))};
}

/* What lighting a stretch as it is at f may be off by, where it is as told at f, at its beginning, at its end and at f
 * without the gradient's bend: by how much it does not run straight in between, by part of what the bend changes, and
 * for what was due before, by what it has changed since. */
INLINE vf light_doubt(const TiledJob *j, const vf facings[4], const vf powers[4], vf f, vf due)
{
    const CtsShade *shade = j->shade;
    const vf waited = vf_min(due, vf_of(j->most_due));
    const vf uneven = shade->diffuse * vf_abs(facings[1] + (facings[2] - facings[1]) * f - facings[0]) +
                      shade->specular * vf_abs(powers[1] + (powers[2] - powers[1]) * f - powers[0]);
    const vf turned =
        shade->diffuse * vf_abs(facings[1] - facings[0]) + shade->specular * vf_abs(powers[1] - powers[0]);
    const vf bent = shade->diffuse * vf_abs(facings[3] - facings[0]) + shade->specular * vf_abs(powers[3] - powers[0]);
    return due * (uneven + 0.5f * bent) + waited * turned;
}

/* Light what is due of these packets as the stretch of `span` sheets from `part` of those behind layer q on, the middle
 * of the light that is lost a fraction f of the way. Returns those it should be told of more finely. */
INLINE unsigned light_packets(const TiledJob *j, const Packet *pk, Way way, bool draft, unsigned packets, int q,
                              int part, int span, bool inner, vf f, Light *light, Lit *lit, Course *course)
{
    const CtsShade *shade = j->shade;
    const int sheet = q * j->samples + part, whole = part + span == j->samples;
    Slope to = course->slope, from = to;
    /* One sheet, or both where none has been carried here. */
    for (int i = course->slope_sheet == sheet; i < 2; i++) {
        from = to;
        to = i == 0 ? slope_at(j, pk, way, q, part, inner)
                    : slope_at(j, pk, way, q + whole, whole ? 0 : part + span, inner);
    }
    course->slope = to;
    course->slope_sheet = sheet + span;
    Turn turn; /* zeroing it as a whole would cost more than all that follows */
    turn.start = from;
    turn.rise = less(&to, &from);
    turn.bend = (Slope){vf_of(0), vf_of(0), vf_of(0)};
    const vmask worth = vf_lt(vf_of(5 * j->most_due), lit->due);
    const bool may_bend = way != WAY_STRAIGHT;
    const vf straight = facing_at(&turn, false, f);
    /* Along an axis the gradient runs straight between layers. */
    const unsigned bent = may_bend ? packets & any_in(worth) : 0;
    if (bent) {
        const Slope a = from, b = to; /* what a function is given the address of, is kept in memory everywhere */
        turn.bend = find_slope_bend(j, pk, way, q, part + span / 2, inner, mask_packets(bent), &a, &b);
        turn.rise = less(&turn.rise, &turn.bend);
    }
    vf facings[4] = {facing_at(&turn, may_bend, f), facing_at(&turn, may_bend, vf_of(0)),
                     facing_at(&turn, may_bend, vf_of(1)), straight};
    vf powers[4], facing, power;
    specular_powers(shade, facings, powers, may_bend ? 4 : 3);
    facing = facings[0];
    power = powers[0];
    if (!may_bend)
        powers[3] = power;
    vf glow_doubt = light_doubt(j, facings, powers, f, lit->due);
    const vmask now = mask_packets(packets);
    const unsigned uneven = packets & any_in(vf_lt(vf_of(j->may_turn), glow_doubt));
    const unsigned turning = bent | uneven | any_in(mask_and(vf_lt(dot(&from, &to), vf_of(0)), worth));
    if (turning) {
        const Turn copy = turn;
        vf mean = facing, mean_power = power;
        (way == WAY_STRAIGHT ? mean_of_straight_turn : mean_of_bent_turn)(shade, &copy, f, mask_packets(turning), &mean,
                                                                          &mean_power);
        facing = mean;
        power = mean_power;
        glow_doubt = select_f(mask_packets(turning), 0.5f * glow_doubt, glow_doubt);
    }
    if (!draft) /* two standard deviations */
        light->doubt.colour += select_f(now, 4 * glow_doubt * glow_doubt, vf_of(0));
    const Glow glow = {shade->ambient + shade->diffuse * facing, shade->specular * power};
    lit->glow.colour = select_f(now, glow.colour, lit->glow.colour);
    lit->glow.white = select_f(now, glow.white, lit->glow.white);
    const vf colour = select_f(now, glow.colour, vf_of(0)), white = select_f(now, lit->due * glow.white, vf_of(0));
    lit->r += light->r * colour + white;
    lit->g += light->g * colour + white;
    lit->b += light->b * colour + white;
    lit->due = select_f(now, vf_of(0), lit->due);
    light->r = select_f(now, vf_of(0), light->r);
    light->g = select_f(now, vf_of(0), light->g);
    light->b = select_f(now, vf_of(0), light->b);
    lit->had |= packets;
    return packets & any_in(vf_lt(vf_of(j->may_shine), glow_doubt));
}

/* A stretch has taken `lost` of the light; moment is the sum of that, each time how far on. Returns the packets whose
 * light changes too much on the stretch to be told at one place. */
INLINE unsigned light_stretch(const TiledJob *j, const Packet *pk, Way way, bool draft, int q, int part, int span,
                              bool inner, vf lost, vf moment, Light *light, Lit *lit, Course *course)
{
    const uint64_t before = course->timed ? cts_tiled_ticks() : 0;
    lit->due += lost;
    lit->last = select_i(vf_lt(vf_of(0), lost), vi_of(q * j->samples + part), lit->last);
    const unsigned packets = any_in(vf_lt(vf_of(j->most_due), lit->due));
    unsigned uneven = 0;
    if (packets) {
        const vf some = vf_of(1e-12f), f = moment / vf_max(lost, some);
        uneven = light_packets(j, pk, way, draft, packets, q, part, span, inner,
                               select_f(vf_lt(some, lost), f, vf_of(0.5f)), light, lit, course);
    }
    course->ticks += course->timed ? cts_tiled_ticks() - before : 0;
    return uneven;
}

/* Colours that never were worth a slope get the lighting of their packet's last stretch. */
OUTLINE void light_at_last(const TiledJob *j, const Packet *pk, Way way, unsigned packets, Light *light, Lit *lit)
{
    Course course = start_course(false);
    for (int h = 0; h < PACKETS; h++) {
        int last = 0;
        for (int l = 0; l < CTS_PACKET; l++)
            last = lit->last[h * CTS_PACKET + l] > last ? lit->last[h * CTS_PACKET + l] : last;
        if (packets >> h & 1)
            light_packets(j, pk, way, false, 1u << h, last / j->samples, last % j->samples, j->samples / j->sheets,
                          false, vf_of(0.5f), light, lit, &course);
    }
}

/* What is due at the end gets the last lighting there was. */
INLINE void light_rest(const TiledJob *j, const Packet *pk, Way way, Light *light, Lit *lit)
{
    const unsigned dark = any_in(vf_lt(vf_of(0), lit->due)) & ~lit->had;
    if (dark) {
        Light dark_light = *light;
        Lit dark_lit = *lit;
        light_at_last(j, pk, way, dark, &dark_light, &dark_lit);
        *light = dark_light;
        *lit = dark_lit;
    }
    light->r = lit->r + light->r * lit->glow.colour + lit->due * lit->glow.white;
    light->g = lit->g + light->g * lit->glow.colour + lit->due * lit->glow.white;
    light->b = lit->b + light->b * lit->glow.colour + lit->due * lit->glow.white;
}
