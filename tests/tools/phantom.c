/* phantom: writes a made-up CT head as a raw volume, from formulas alone.
 *
 *     phantom [--size NX,NY,NZ] [--spacing X,Y,Z] [--tilt-deg A] [--supersample N] [--table] FILE
 *
 * FILE gets int16 little-endian HU, x fastest. The axes are patient coordinates (LPS): x to the left, y to the back,
 * z to the head, millimetres, the volume's centre at 0, so the face looks along -y. The head has air, fat, soft tissue,
 * bone, teeth, a bleeding and a metal pin on its left side only, and on the pin stands a bone-like letter L: in a
 * picture of the face the L reads as an L and stands on the right, or the picture is mirrored. With --tilt-deg slices
 * are cut as a gantry tilted about the x axis cuts them, while the table moves along z.
 *
 * Only + - * / and comparisons are used, so that the bytes are the same on any machine; tilt takes its sine and cosine
 * from a series for the same reason. */
#include <getopt.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

enum Kind { ELLIPSOID, BOX, CYLINDER_X, CYLINDER_Z };

/* Half sizes hx, hy, hz around a centre, millimetres. Later shapes cover earlier ones. */
typedef struct Shape {
    enum Kind kind;
    double x, y, z, hx, hy, hz;
    double hu;
} Shape;

static const Shape head[] = {
    {CYLINDER_Z, 0, 18, -80, 44, 48, 60, 40},   /* neck */
    {ELLIPSOID, 0, -34, -46, 48, 50, 42, 25},   /* jaw and cheeks */
    {ELLIPSOID, 0, 5, 15, 76, 92, 88, 15},      /* skin */
    {ELLIPSOID, 0, -86, -14, 11, 19, 19, 30},   /* nose */
    {ELLIPSOID, 77, 12, -4, 8, 14, 22, 20},     /* ears */
    {ELLIPSOID, -77, 12, -4, 8, 14, 22, 20},    /* */
    {ELLIPSOID, 0, 5, 15, 73, 88, 85, -90},     /* fat */
    {ELLIPSOID, 0, -34, -46, 45, 46, 39, 50},   /* muscle of the face */
    {ELLIPSOID, 0, 5, 15, 70, 85, 82, 55},      /* muscle of the scalp */
    {ELLIPSOID, 0, 6, 17, 67, 81, 79, 1000},    /* skull: outer table, spongy layer, inner table */
    {ELLIPSOID, 0, 6, 17, 64, 78, 76, 450},     /* */
    {ELLIPSOID, 0, 6, 17, 62, 76, 74, 950},     /* */
    {ELLIPSOID, 0, 6, 17, 59, 73, 71, 35},      /* brain */
    {ELLIPSOID, 0, -46, -32, 34, 28, 20, 700},  /* upper jaw and cheek bones */
    {ELLIPSOID, 0, -38, -64, 38, 34, 12, 1100}, /* lower jaw: an arch ... */
    {ELLIPSOID, 0, -28, -64, 30, 34, 22, 50},   /* ... open to the back */
    {BOX, 0, -68, -48, 17, 5, 6, 1900},         /* teeth */
    {ELLIPSOID, 28, -64, 3, 18, 18, 15, -80},   /* eye sockets with fat, eyes */
    {ELLIPSOID, -28, -64, 3, 18, 18, 15, -80},  /* */
    {ELLIPSOID, 28, -66, 3, 12, 12, 12, 15},    /* */
    {ELLIPSOID, -28, -66, 3, 12, 12, 12, 15},   /* */
    {ELLIPSOID, 0, -66, -20, 6, 16, 9, -1000},  /* nose cavity */
    {CYLINDER_Z, 0, -6, -75, 8, 9, 45, -1000},  /* throat */
    {CYLINDER_Z, 0, 30, -85, 17, 15, 45, 550},  /* spine and its canal */
    {CYLINDER_Z, 0, 36, -85, 8, 7, 45, 20},     /* */
    {ELLIPSOID, 10, 4, 28, 5, 26, 9, 8},        /* ventricles */
    {ELLIPSOID, -10, 4, 28, 5, 26, 9, 8},       /* */
    {ELLIPSOID, 32, 18, 42, 10, 12, 9, 75},     /* bleeding, left */
    {CYLINDER_X, 72, -18, 44, 30, 5, 5, 3071},  /* metal pin, left */
    {BOX, 92, -18, 53, 2.5, 2.5, 6, 1300},      /* a post on the pin, and on it the letter L: its stem, its foot */
    {BOX, 82, -18, 82, 4, 4, 24, 1300},         /* */
    {BOX, 92, -18, 62, 14, 4, 4, 1300},         /* */
};

/* A table top under the back of the head: a thin shell with a light core. */
static const Shape table[] = {
    {BOX, 0, 104, 0, 96, 4, 400, 120},
    {BOX, 0, 104, 0, 94, 2.5, 400, -850},
};

static double square(double v)
{
    return v * v;
}

static bool inside(const Shape *s, double x, double y, double z)
{
    const double u = (x - s->x) / s->hx, v = (y - s->y) / s->hy, w = (z - s->z) / s->hz;
    switch (s->kind) {
    case ELLIPSOID:
        return square(u) + square(v) + square(w) <= 1;
    case CYLINDER_X:
        return square(u) <= 1 && square(v) + square(w) <= 1;
    case CYLINDER_Z:
        return square(w) <= 1 && square(u) + square(v) <= 1;
    case BOX:
        return square(u) <= 1 && square(v) <= 1 && square(w) <= 1;
    }
    return false;
}

enum { N_HEAD = sizeof head / sizeof *head, N_TABLE = sizeof table / sizeof *table };

/* The shapes that one row of voxels can meet, the covering ones first. */
typedef struct Scene {
    const Shape *shapes[N_HEAD + N_TABLE];
    int n;
} Scene;

static void add_near(Scene *scene, const Shape *shapes, int n, const double y[2], const double z[2])
{
    for (int i = n - 1; i >= 0; i--) {
        const Shape *s = &shapes[i];
        if (y[0] <= s->y + s->hy && y[1] >= s->y - s->hy && z[0] <= s->z + s->hz && z[1] >= s->z - s->hz)
            scene->shapes[scene->n++] = s;
    }
}

static double hu_at(const Scene *scene, double x, double y, double z)
{
    for (int i = 0; i < scene->n; i++)
        if (inside(scene->shapes[i], x, y, z))
            return scene->shapes[i]->hu;
    return -1000;
}

/* Taylor series: libm's last bit may differ between machines. */
static void sin_cos(double deg, double *s, double *c)
{
    const double a = deg * (3.14159265358979323846 / 180);
    double term = 1;
    *s = *c = 0;
    for (int n = 0; n < 24; n += 2) {
        *c += n % 4 ? -term : term;
        term *= a / (n + 1);
        *s += n % 4 ? -term : term;
        term *= a / (n + 2);
    }
}

typedef struct Options {
    int size[3], supersample;
    double spacing_mm[3], tilt_deg;
    bool with_table;
    const char *file;
} Options;

static int tent(int a, int n)
{
    return a < n ? 2 * a + 1 : 2 * (2 * n - 1 - a) + 1;
}

/* One voxel: 2 * supersample points along each axis, weighted by a tent that reaches to the neighbours' centres, much
 * as a scanner blurs. Along an axis the weights are odd numbers, 1 3 5 ... 5 3 1, so the sum stays exact. */
static int16_t voxel(const Options *o, const Scene *scene, int i, int j, int k, double sin_tilt, double cos_tilt)
{
    const int n = o->supersample;
    double sum = 0, weights = 0;
    for (int c = 0; c < 2 * n; c++)
        for (int b = 0; b < 2 * n; b++)
            for (int a = 0; a < 2 * n; a++) {
                const double x = (i + (a + 0.5) / n - 0.5 - 0.5 * o->size[0]) * o->spacing_mm[0];
                const double row = (j + (b + 0.5) / n - 0.5 - 0.5 * o->size[1]) * o->spacing_mm[1];
                const double z = (k + (c + 0.5) / n - 0.5 - 0.5 * o->size[2]) * o->spacing_mm[2];
                const double weight = (double)tent(a, n) * tent(b, n) * tent(c, n);
                sum += weight * hu_at(scene, x, row * cos_tilt, z + row * sin_tilt);
                weights += weight;
            }
    return (int16_t)floor(sum / weights + 0.5);
}

static Scene row_scene(const Options *o, int j, int k, double sin_tilt, double cos_tilt)
{
    const double row = (j + 0.5 - 0.5 * o->size[1]) * o->spacing_mm[1], half = 1.5 * o->spacing_mm[1];
    const double slice = (k + 0.5 - 0.5 * o->size[2]) * o->spacing_mm[2] + row * sin_tilt;
    const double reach = 1.5 * o->spacing_mm[2] + half; /* generous: a shape too many costs time only */
    const double y[2] = {row * cos_tilt - half, row * cos_tilt + half}, z[2] = {slice - reach, slice + reach};
    Scene scene = {.n = 0};
    add_near(&scene, head, N_HEAD, y, z);
    if (o->with_table)
        add_near(&scene, table, N_TABLE, y, z);
    return scene;
}

static int write_volume(const Options *o)
{
    double sin_tilt, cos_tilt;
    int result = 1;
    FILE *f = fopen(o->file, "wb");
    uint8_t *row = malloc((size_t)o->size[0] * 2);
    if (!f || !row)
        goto end;
    sin_cos(o->tilt_deg, &sin_tilt, &cos_tilt);
    for (int k = 0; k < o->size[2]; k++)
        for (int j = 0; j < o->size[1]; j++) {
            const Scene scene = row_scene(o, j, k, sin_tilt, cos_tilt);
            for (int i = 0; i < o->size[0]; i++) {
                const uint16_t v = (uint16_t)voxel(o, &scene, i, j, k, sin_tilt, cos_tilt);
                row[2 * i] = (uint8_t)(v & 0xff);
                row[2 * i + 1] = (uint8_t)(v >> 8);
            }
            if (fwrite(row, 2, (size_t)o->size[0], f) != (size_t)o->size[0])
                goto end;
        }
    result = 0;
end:
    free(row);
    if (f && fclose(f))
        result = 1;
    if (result)
        fprintf(stderr, "phantom: %s: cannot be written\n", o->file);
    return result;
}

int main(int argc, char **argv)
{
    static const struct option longs[] = {
        {"size", required_argument, NULL, 's'},        {"spacing", required_argument, NULL, 'm'},
        {"tilt-deg", required_argument, NULL, 't'},    {"table", no_argument, NULL, 'b'},
        {"supersample", required_argument, NULL, 'n'}, {NULL, 0, NULL, 0},
    };
    Options o = {.size = {64, 64, 48}, .spacing_mm = {3.5, 3.5, 4.5}, .supersample = 3};
    bool good = true;
    for (int c; (c = getopt_long(argc, argv, "", longs, NULL)) != -1;) {
        if (c == 's')
            good &= sscanf(optarg, "%d,%d,%d", &o.size[0], &o.size[1], &o.size[2]) == 3;
        else if (c == 'm')
            good &= sscanf(optarg, "%lf,%lf,%lf", &o.spacing_mm[0], &o.spacing_mm[1], &o.spacing_mm[2]) == 3;
        else if (c == 't')
            good &= sscanf(optarg, "%lf", &o.tilt_deg) == 1 && fabs(o.tilt_deg) <= 45;
        else if (c == 'n')
            good &= sscanf(optarg, "%d", &o.supersample) == 1 && o.supersample >= 1 && o.supersample <= 16;
        else if (c == 'b')
            o.with_table = true;
        else
            good = false;
    }
    for (int a = 0; a < 3; a++)
        good &= o.size[a] >= 1 && o.size[a] <= 4096 && o.spacing_mm[a] > 0;
    if (!good || optind != argc - 1) {
        fputs("usage: phantom [--size NX,NY,NZ] [--spacing X,Y,Z] [--tilt-deg A] [--supersample N] [--table] FILE\n",
              stderr);
        return 2;
    }
    o.file = argv[optind];
    return write_volume(&o);
}
