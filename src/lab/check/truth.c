#include "lab/check/truth.h"

#include "base/compare.h"
#include "base/vec3.h"
#include <math.h>
#include <string.h>

enum { MAX_SPLITS = 4 * CTS_MAX_POINTS };

double cts_truth_integral(double (*f)(double, const void *), const void *data, double a, double b)
{
    /* x = (a + b)/2 + (b - a)/2 tanh(pi/2 sinh s); distances from the ends are kept apart to lose no digits. */
    const double half = 0.5 * (b - a), reach = 3.9;
    double sum = f(a + half, data) * M_PI_2, last = 0;
    for (int halving = 0; halving < 12; halving++) {
        const double h = ldexp(1, -halving);
        for (double s = halving == 0 ? h : h; s <= reach; s += halving == 0 ? h : 2 * h) {
            const double y = M_PI_2 * sinh(s);
            const double from_end = half * exp(-y) / cosh(y);
            const double weight = M_PI_2 * cosh(s) / (cosh(y) * cosh(y));
            sum += weight * (f(a + from_end, data) + f(b - from_end, data));
        }
        const double value = sum * h * half;
        if (halving > 3 && fabs(value - last) <= 1e-14 * fabs(value))
            return value;
        last = value;
    }
    return last;
}

/* Between two control points: opacity is linear per mm, so that depth has a closed form. */
typedef struct LinearOpacity {
    double a0, slope, unit_mm, scale;
    bool capped;
} LinearOpacity;

static double line_depth(const LinearOpacity *l, double t)
{
    if (l->capped)
        return CTS_MAX_EXTINCTION_PER_MM * l->scale * t;
    const double a1 = l->a0 + l->slope * t;
    const double mean = -log1p(-0.5 * (l->a0 + fmin(a1, 1)));
    if (fabs(a1 - l->a0) < 1e-5 * (1 - fmin(l->a0, a1))) {
        /* The closed form would cancel: three terms of its series about the middle. */
        const double r = 0.5 * (a1 - l->a0) / (1 - 0.5 * (l->a0 + a1));
        return l->scale * t / l->unit_mm * (mean + r * r / 6);
    }
    const double b0 = 1 - l->a0, b1 = fmax(1 - a1, 0);
    const double g0 = b0 > 0 ? b0 * log(b0) - b0 : 0, g1 = b1 > 0 ? b1 * log(b1) - b1 : 0;
    return l->scale * (g1 - g0) / (l->slope * l->unit_mm);
}

static double line_alpha(double t, const void *data)
{
    return -expm1(-line_depth(data, t));
}

/* Integral of line_alpha over the line. Short segments of low opacity are nearly parabolas, for which three points
 * suffice. */
static double alpha_integral(const LinearOpacity *l, double mm, double a1)
{
    if (line_depth(l, mm) < 0.02 && (l->capped || fabs(a1 - l->a0) < 0.02 * (1 - fmax(l->a0, a1))))
        return mm / 18 *
               (5 * line_alpha(0.1127016653792583 * mm, l) + 8 * line_alpha(0.5 * mm, l) +
                5 * line_alpha(0.8872983346207417 * mm, l));
    return cts_truth_integral(line_alpha, l, 0, mm);
}

static double on_line(double x0, double y0, double x1, double y1, double x)
{
    return x1 > x0 ? y0 + (y1 - y0) * ((x - x0) / (x1 - x0)) : y1;
}

/* The preset's lines just beside hu, on the side of inside. Written apart from cts_preset_opacity() on purpose. */
static double opacity_beside(const CtsPreset *p, double hu, double inside)
{
    const int n = p->n_opacity;
    if (inside < p->opacity[0].hu)
        return p->opacity[0].opacity;
    for (int i = 0; i + 1 < n; i++)
        if (p->opacity[i].hu <= inside && inside < p->opacity[i + 1].hu)
            return on_line(p->opacity[i].hu, p->opacity[i].opacity, p->opacity[i + 1].hu, p->opacity[i + 1].opacity,
                           hu);
    return p->opacity[n - 1].opacity;
}

static double colour_beside(const CtsPreset *p, int c, double hu, double inside)
{
    const int n = p->n_colour;
    if (inside < p->colour[0].hu)
        return p->colour[0].rgb[c];
    for (int i = 0; i + 1 < n; i++)
        if (p->colour[i].hu <= inside && inside < p->colour[i + 1].hu)
            return on_line(p->colour[i].hu, p->colour[i].rgb[c], p->colour[i + 1].hu, p->colour[i + 1].rgb[c], hu);
    return p->colour[n - 1].rgb[c];
}

static double lit(const CtsPreset *p, double facing, double colour)
{
    if (facing < 0)
        return colour;
    return colour * (p->ambient + p->diffuse * facing) + (facing > 0 ? p->specular * pow(facing, p->power) : 0);
}

/* A segment without a control point inside; c(t) is linear: integral of c dA = c(end) A(end) - c' integral of A. */
static void add_linear_segment(const CtsPreset *p, double scale, double hu0, double hu1, double mm, double facing,
                               CtsTruthSum *sum)
{
    const double middle = 0.5 * (hu0 + hu1);
    const double a0 = opacity_beside(p, hu0, middle), a1 = opacity_beside(p, hu1, middle);
    const double cap = -expm1(-CTS_MAX_EXTINCTION_PER_MM * p->unit_distance_mm);
    if ((a0 < cap) != (a1 < cap) && a0 != a1) {
        const double part = (cap - a0) / (a1 - a0);
        if (part > 1e-15 && part < 1 - 1e-15) {
            add_linear_segment(p, scale, hu0, hu0 + part * (hu1 - hu0), part * mm, facing, sum);
            add_linear_segment(p, scale, hu0 + part * (hu1 - hu0), hu1, (1 - part) * mm, facing, sum);
            return;
        }
    }
    const LinearOpacity line = {.a0 = a0,
                                .slope = mm > 0 ? (a1 - a0) / mm : 0,
                                .unit_mm = p->unit_distance_mm,
                                .scale = scale,
                                .capped = 0.5 * (a0 + a1) >= cap};
    const double left = exp(-sum->depth), alpha = line_alpha(mm, &line);
    double area = NAN;
    for (int c = 0; c < 3; c++) {
        const double c0 = lit(p, facing, colour_beside(p, c, hu0, middle));
        const double c1 = lit(p, facing, colour_beside(p, c, hu1, middle));
        if (c0 != c1 && isnan(area))
            area = alpha_integral(&line, mm, a1);
        sum->rgb[c] += left * (c0 == c1 ? c0 * alpha : c1 * alpha - (c1 - c0) / mm * area);
    }
    sum->depth += line_depth(&line, mm);
}

static int splits_between(const CtsPreset *p, double hu0, double hu1, double cut[MAX_SPLITS])
{
    const double low = fmin(hu0, hu1), high = fmax(hu0, hu1);
    int n = 0;
    cut[n++] = hu0;
    for (int i = 0; i < p->n_opacity + p->n_colour; i++) {
        const double hu = i < p->n_opacity ? p->opacity[i].hu : p->colour[i - p->n_opacity].hu;
        if (!(hu > low && hu < high))
            continue;
        int at = n;
        while (at > 1 && (hu1 > hu0 ? cut[at - 1] > hu : cut[at - 1] < hu))
            at--;
        memmove(cut + at + 1, cut + at, (size_t)(n - at) * sizeof *cut);
        cut[at] = hu;
        n++;
    }
    cut[n] = hu1;
    return n;
}

void cts_truth_add(const CtsPreset *preset, double extinction_scale, const CtsTruthInterval *s, CtsTruthSum *light)
{
    double cut[MAX_SPLITS];
    const int n_splits = splits_between(preset, s->hu0, s->hu1, cut);
    for (int k = 0; k < n_splits; k++) {
        const double share = s->hu0 == s->hu1 ? 1 : (cut[k + 1] - cut[k]) / (s->hu1 - s->hu0);
        add_linear_segment(preset, extinction_scale, cut[k], cut[k + 1], share * s->length_mm, s->facing, light);
    }
}

void cts_truth_pixel(const CtsTruthSum *light, double rgba[4])
{
    for (int c = 0; c < 3; c++)
        rgba[c] = light->rgb[c];
    rgba[3] = -expm1(-light->depth);
}

void cts_truth_intervals(const CtsPreset *preset, double extinction_scale, const CtsTruthInterval *intervals, int n,
                         double rgba[4])
{
    CtsTruthSum light = {{0, 0, 0}, 0};
    for (int i = 0; i < n; i++)
        cts_truth_add(preset, extinction_scale, &intervals[i], &light);
    cts_truth_pixel(&light, rgba);
}

static double default_scale(const CtsVolume *v, const CtsTruthCamera *camera)
{
    /* The longest of the four diagonals of the box of voxel centres. */
    double longest = 0;
    for (int s = 0; s < 4; s++) {
        double d[3] = {0, 0, 0};
        for (int c = 0; c < 3; c++)
            d[c] = (v->dims[0] - 1) * (s & 1 ? -1 : 1) * v->step_lps[0][c] +
                   (v->dims[1] - 1) * (s & 2 ? -1 : 1) * v->step_lps[1][c] + (v->dims[2] - 1) * v->step_lps[2][c];
        cts_raise_to(&longest, sqrt(cts_dot3(d, d)));
    }
    return longest / (0.95 * fmin(camera->width, camera->height));
}

/* Voxels along each axis that a vector in millimetres spans, by the heights of the cell over its sides. */
static void voxels_along(const CtsVolume *volume, const double mm[3], double vox[3])
{
    for (int a = 0; a < 3; a++) {
        double normal[3];
        cts_cross3(volume->step_lps[(a + 1) % 3], volume->step_lps[(a + 2) % 3], normal);
        vox[a] = cts_dot3(mm, normal) / cts_dot3(volume->step_lps[a], normal);
    }
}

void cts_truth_voxel(const CtsVolume *volume, const double point_lps[3], double vox[3])
{
    double mm[3];
    for (int c = 0; c < 3; c++)
        mm[c] = point_lps[c] - volume->origin_lps[c];
    voxels_along(volume, mm, vox);
}

bool cts_truth_ray(const CtsVolume *volume, const CtsTruthCamera *camera, double x, double y, CtsTruthRay *ray)
{
    const double az = camera->azimuth_deg * M_PI / 180, el = camera->elevation_deg * M_PI / 180;
    const double scale = camera->mm_per_pixel > 0 ? camera->mm_per_pixel : default_scale(volume, camera);
    /* From the front: right is +x, up is +z. Azimuth rotates about z, elevation about the picture's right. */
    const double right[3] = {cos(az), sin(az), 0}, ahead[3] = {-sin(az), cos(az), 0};
    double forward[3], up[3];
    for (int c = 0; c < 3; c++) {
        forward[c] = cos(el) * ahead[c] - (c == 2 ? sin(el) : 0);
        up[c] = sin(el) * ahead[c] + (c == 2 ? cos(el) : 0);
    }
    const double u = (x + 0.5 - camera->width / 2.0) * scale, w = (camera->height / 2.0 - y - 0.5) * scale;
    for (int c = 0; c < 3; c++) {
        ray->direction_lps[c] = forward[c];
        ray->point_lps[c] = volume->origin_lps[c] + u * right[c] + w * up[c];
        for (int a = 0; a < 3; a++)
            ray->point_lps[c] += 0.5 * (volume->dims[a] - 1) * volume->step_lps[a][c];
    }
    ray->from_mm = -INFINITY;
    ray->to_mm = INFINITY;
    double vox[3], speed[3];
    cts_truth_voxel(volume, ray->point_lps, vox);
    voxels_along(volume, forward, speed);
    for (int a = 0; a < 3; a++) {
        const double at = vox[a], last = volume->dims[a] - 1;
        /* Sines and cosines of right angles leave 1e-16. */
        if (fabs(speed[a]) < 1e-14 * (fabs(speed[0]) + fabs(speed[1]) + fabs(speed[2]))) {
            if (at < -1e-9 || at > last + 1e-9)
                return false;
            continue;
        }
        ray->from_mm = fmax(ray->from_mm, fmin(-at / speed[a], (last - at) / speed[a]));
        ray->to_mm = fmin(ray->to_mm, fmax(-at / speed[a], (last - at) / speed[a]));
    }
    return ray->to_mm >= ray->from_mm;
}

void cts_truth_ray_point(const CtsTruthRay *ray, double t_mm, double point_lps[3])
{
    for (int c = 0; c < 3; c++)
        point_lps[c] = ray->point_lps[c] + t_mm * ray->direction_lps[c];
}

void cts_truth_ray_voxel(const CtsVolume *volume, const CtsTruthRay *ray, double t_mm, double vox[3])
{
    double point_lps[3];
    cts_truth_ray_point(ray, t_mm, point_lps);
    cts_truth_voxel(volume, point_lps, vox);
}
