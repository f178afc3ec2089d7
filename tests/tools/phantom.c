/* phantom: writes a made-up CT head, or trunk, as a raw volume, from formulas alone.
 *
 *     phantom [--size NX,NY,NZ] [--spacing X,Y,Z] [--tilt-deg A] [--supersample N] [--soft MM] [--table]
 *             [--body] [--labels NIFTI] FILE
 *
 * FILE gets int16 little-endian HU, x fastest. The axes are patient coordinates (LPS): x to the left, y to the back,
 * z to the head, millimetres, the volume's centre at 0, so the face looks along -y. The head has air, fat, soft tissue,
 * bone, teeth, a bleeding and a metal pin on its left side only, and on the pin stands a bone-like letter L: in a
 * picture of the face the L reads as an L and stands on the right, or the picture is mirrored. With --tilt-deg slices
 * are cut as a gantry tilted about the x axis cuts them, while the table moves along z. With --soft shapes have edges
 * so wide, by their distance: fine volumes without the rings that points in voxels leave. With --body it is a trunk
 * whose vessels hold contrast medium, and --labels writes whose each voxel is, a number an organ.
 *
 * Only + - * / sqrt and comparisons are used, so that the bytes are the same on any machine; tilt takes its sine and
 * cosine from a series for the same reason. */
#include <getopt.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum Kind { ELLIPSOID, BOX, CYLINDER_X, CYLINDER_Z, RIB };

/* Half sizes hx, hy, hz around a centre, millimetres. Later shapes cover earlier ones. A rib is a tube of radius hz
 * about an ellipse of hx and hy that falls to the front; it ends at y, in front of its centre. */
typedef struct Shape {
    enum Kind kind;
    double x, y, z, hx, hy, hz;
    double hu;
    int label; /* 0: none */
} Shape;

static const double RIB_FALL = 0.4;

static const Shape head[] = {
    {CYLINDER_Z, 0, 18, -80, 44, 48, 60, 40, 0},   /* neck */
    {ELLIPSOID, 0, -34, -46, 48, 50, 42, 25, 0},   /* jaw and cheeks */
    {ELLIPSOID, 0, 5, 15, 76, 92, 88, 15, 0},      /* skin */
    {ELLIPSOID, 0, -86, -14, 11, 19, 19, 30, 0},   /* nose */
    {ELLIPSOID, 77, 12, -4, 8, 14, 22, 20, 0},     /* ears */
    {ELLIPSOID, -77, 12, -4, 8, 14, 22, 20, 0},    /* */
    {ELLIPSOID, 0, 5, 15, 73, 88, 85, -90, 0},     /* fat */
    {ELLIPSOID, 0, -34, -46, 45, 46, 39, 50, 0},   /* muscle of the face */
    {ELLIPSOID, 0, 5, 15, 70, 85, 82, 55, 0},      /* muscle of the scalp */
    {ELLIPSOID, 0, 6, 17, 67, 81, 79, 1000, 0},    /* skull: outer table, spongy layer, inner table */
    {ELLIPSOID, 0, 6, 17, 64, 78, 76, 450, 0},     /* */
    {ELLIPSOID, 0, 6, 17, 62, 76, 74, 950, 0},     /* */
    {ELLIPSOID, 0, 6, 17, 59, 73, 71, 35, 0},      /* brain */
    {ELLIPSOID, 0, -46, -32, 34, 28, 20, 700, 0},  /* upper jaw and cheek bones */
    {ELLIPSOID, 0, -38, -64, 38, 34, 12, 1100, 0}, /* lower jaw: an arch ... */
    {ELLIPSOID, 0, -28, -64, 30, 34, 22, 50, 0},   /* ... open to the back */
    {BOX, 0, -68, -48, 17, 5, 6, 1900, 0},         /* teeth */
    {ELLIPSOID, 28, -64, 3, 18, 18, 15, -80, 0},   /* eye sockets with fat, eyes */
    {ELLIPSOID, -28, -64, 3, 18, 18, 15, -80, 0},  /* */
    {ELLIPSOID, 28, -66, 3, 12, 12, 12, 15, 0},    /* */
    {ELLIPSOID, -28, -66, 3, 12, 12, 12, 15, 0},   /* */
    {ELLIPSOID, 0, -66, -20, 6, 16, 9, -1000, 0},  /* nose cavity */
    {CYLINDER_Z, 0, -6, -75, 8, 9, 45, -1000, 0},  /* throat */
    {CYLINDER_Z, 0, 30, -85, 17, 15, 45, 550, 0},  /* spine and its canal */
    {CYLINDER_Z, 0, 36, -85, 8, 7, 45, 20, 0},     /* */
    {ELLIPSOID, 10, 4, 28, 5, 26, 9, 8, 0},        /* ventricles */
    {ELLIPSOID, -10, 4, 28, 5, 26, 9, 8, 0},       /* */
    {ELLIPSOID, 32, 18, 42, 10, 12, 9, 75, 0},     /* bleeding, left */
    {CYLINDER_X, 72, -18, 44, 30, 5, 5, 3071, 0},  /* metal pin, left */
    {BOX, 92, -18, 53, 2.5, 2.5, 6, 1300, 0},      /* a post on the pin, and on it the letter L: its stem, its foot */
    {BOX, 82, -18, 82, 4, 4, 24, 1300, 0},         /* */
    {BOX, 92, -18, 62, 14, 4, 4, 1300, 0},         /* */
};

/* A table top under the back of the head: a thin shell with a light core. */
static const Shape table[] = {
    {BOX, 0, 104, 0, 96, 4, 400, 120, 0},
    {BOX, 0, 104, 0, 94, 2.5, 400, -850, 0},
};

/* Organs of the trunk, but for ribs and vertebrae; labels are those of body_labels.json. */
static const Shape trunk[] = {
    {ELLIPSOID, 0, 0, -20, 172, 112, 310, -100, 0},  /* fat */
    {ELLIPSOID, 128, 12, 172, 78, 62, 58, -100, 0},  /* shoulders */
    {ELLIPSOID, -128, 12, 172, 78, 62, 58, -100, 0}, /* */
    {ELLIPSOID, 0, 0, -20, 160, 101, 300, 55, 0},    /* muscle */
    {ELLIPSOID, 126, 12, 170, 68, 52, 49, 55, 0},    /* */
    {ELLIPSOID, -126, 12, 170, 68, 52, 49, 55, 0},   /* */
    {CYLINDER_Z, 0, 12, 215, 54, 54, 60, 55, 0},     /* neck */
    {ELLIPSOID, 0, -12, -150, 128, 66, 105, -95, 0}, /* fat of the belly */
    {CYLINDER_X, 82, -46, 158, 66, 6, 6, 650, 0},    /* collar bones */
    {CYLINDER_X, -82, -46, 158, 66, 6, 6, 650, 0},   /* */
    {ELLIPSOID, 72, 74, 104, 28, 5, 50, 550, 0},     /* shoulder blades */
    {ELLIPSOID, -72, 74, 104, 28, 5, 50, 550, 0},    /* */
    {ELLIPSOID, 74, 44, -196, 62, 40, 56, 650, 0},   /* wings of the pelvis, hollow */
    {ELLIPSOID, -74, 44, -196, 62, 40, 56, 650, 0},  /* */
    {ELLIPSOID, 66, 26, -180, 62, 44, 62, 50, 0},    /* */
    {ELLIPSOID, -66, 26, -180, 62, 44, 62, 50, 0},   /* */
    {ELLIPSOID, -72, 4, 68, 60, 74, 112, -850, 1},   /* lungs, right and left */
    {ELLIPSOID, 74, 4, 70, 56, 72, 108, -850, 2},    /* */
    {CYLINDER_Z, 0, 4, 150, 8, 8, 60, -1000, 0},     /* windpipe */
    {ELLIPSOID, -56, -8, -36, 84, 76, 58, 110, 4},   /* liver */
    {ELLIPSOID, 74, -24, -48, 50, 46, 44, 30, 5},    /* stomach */
    {ELLIPSOID, 102, 40, -46, 24, 36, 40, 125, 6},   /* spleen */
    {ELLIPSOID, 62, 52, -112, 24, 22, 50, 140, 7},   /* kidneys */
    {ELLIPSOID, -62, 52, -118, 24, 22, 50, 140, 7},  /* */
    {ELLIPSOID, 20, -22, 38, 52, 38, 54, 150, 3},    /* heart */
    {CYLINDER_Z, 12, 40, -20, 12, 12, 150, 280, 8},  /* aorta */
    {ELLIPSOID, 0, 8, 124, 22, 44, 16, 280, 8},      /* */
    {CYLINDER_Z, -6, -26, 100, 13, 13, 40, 280, 8},  /* */
    {ELLIPSOID, -74, -34, -30, 15, 14, 13, 60, 9},   /* a tumour in the liver */
    {BOX, 0, -80, 86, 15, 5, 54, 400, 0},            /* breastbone */
};

static double square(double v)
{
    return v * v;
}

/* How far outside a shape's surface a point lies, to first order; below 0 inside. */
static double distance_mm(const Shape *s, double x, double y, double z)
{
    if (s->kind == RIB) {
        const double u = x / s->hx, v = y / s->hy, w = z - s->z - RIB_FALL * y;
        const double out = (u * u + v * v - 1) / (2 * sqrt(square(u / s->hx) + square(v / s->hy)) + 1e-9);
        return fmax(sqrt(out * out + w * w) - s->hz, s->y - y);
    }
    const double p[3] = {x - s->x, y - s->y, z - s->z}, h[3] = {s->hx, s->hy, s->hz};
    double form = 0, slope = 0, most = -1e9;
    for (int c = 0; c < 3; c++) {
        const bool is_flat = s->kind == BOX || (s->kind == CYLINDER_X && c == 0) || (s->kind == CYLINDER_Z && c == 2);
        const double u = p[c] / h[c];
        if (is_flat)
            most = fmax(most, fabs(p[c]) - h[c]);
        else {
            form += u * u;
            slope += square(u / h[c]);
        }
    }
    return s->kind == BOX ? most : fmax(most, (form - 1) / (2 * sqrt(slope) + 1e-9));
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
    case RIB:
        return distance_mm(s, x, y, z) <= 0;
    }
    return false;
}

enum {
    N_HEAD = sizeof head / sizeof *head,
    N_TABLE = sizeof table / sizeof *table,
    N_TRUNK = sizeof trunk / sizeof *trunk,
    N_RIBS = 11,
    N_VERTEBRAE = 18,
    N_BODY = N_TRUNK + N_RIBS + 3 * N_VERTEBRAE
};

/* The trunk's shapes with ribs, and vertebrae: a body, a spine behind it and a wing to each side, and disc between. */
static void make_body(Shape body[N_BODY])
{
    int n = 0;
    for (; n < N_TRUNK; n++)
        body[n] = trunk[n];
    for (int i = 0; i < N_RIBS; i++) {
        const double wide = i < 5 ? 84 + 12 * i : 136, deep = i < 4 ? 55 + 7 * i : 82;
        body[n++] = (Shape){RIB, 0, i < 7 ? -200 : 30 * (i - 7) - 60, 150 - 20 * i, wide, deep, 5.5, 700, 0};
    }
    for (int i = 0; i < N_VERTEBRAE; i++) {
        const double z = 200 - 24 * i;
        body[n++] = (Shape){CYLINDER_Z, 0, 68, z, 20, 17, 10, 450, 0};
        body[n++] = (Shape){BOX, 0, 94, z - 6, 3.5, 14, 8, 600, 0};
        body[n++] = (Shape){BOX, 0, 84, z, 30, 4, 5, 600, 0};
    }
}

/* The shapes that one row of voxels can meet, the covering ones first. */
typedef struct Scene {
    const Shape *shapes[N_BODY + N_HEAD + N_TABLE];
    int n;
} Scene;

static void add_near(Scene *scene, const Shape *shapes, int n, const double y[2], const double z[2])
{
    for (int i = n - 1; i >= 0; i--) {
        const Shape *s = &shapes[i];
        const bool is_rib = s->kind == RIB;
        const double at = is_rib ? 0 : s->y, hy = is_rib ? s->hy + s->hz : s->hy;
        const double hz = is_rib ? RIB_FALL * hy + 2 * s->hz : s->hz;
        if (y[0] <= at + hy && y[1] >= at - hy && z[0] <= s->z + hz && z[1] >= s->z - hz)
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

/* The same with edges this wide: every shape covers what lies under it by a ramp. */
static double soft_hu_at(const Scene *scene, double x, double y, double z, double edge_mm)
{
    double hu = -1000;
    for (int i = scene->n - 1; i >= 0; i--) {
        const double share = fmin(fmax(0.5 - distance_mm(scene->shapes[i], x, y, z) / edge_mm, 0), 1);
        hu += (scene->shapes[i]->hu - hu) * share * share * (3 - 2 * share);
    }
    return hu;
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
    double spacing_mm[3], tilt_deg, edge_mm;
    bool with_table, is_body;
    const char *file, *labels;
    Shape body[N_BODY];
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
    if (o->edge_mm > 0) {
        const double row = (j + 0.5 - 0.5 * o->size[1]) * o->spacing_mm[1];
        const double x = (i + 0.5 - 0.5 * o->size[0]) * o->spacing_mm[0];
        const double z = (k + 0.5 - 0.5 * o->size[2]) * o->spacing_mm[2] + row * sin_tilt;
        return (int16_t)floor(soft_hu_at(scene, x, row * cos_tilt, z, o->edge_mm) + 0.5);
    }
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
    const double row = (j + 0.5 - 0.5 * o->size[1]) * o->spacing_mm[1], half = o->edge_mm + 1.5 * o->spacing_mm[1];
    const double slice = (k + 0.5 - 0.5 * o->size[2]) * o->spacing_mm[2] + row * sin_tilt;
    const double reach = o->edge_mm + 1.5 * o->spacing_mm[2] + half; /* generous: a shape too many costs time only */
    const double y[2] = {row * cos_tilt - half, row * cos_tilt + half}, z[2] = {slice - reach, slice + reach};
    Scene scene = {.n = 0};
    add_near(&scene, o->is_body ? o->body : head, o->is_body ? N_BODY : N_HEAD, y, z);
    if (o->with_table)
        add_near(&scene, table, N_TABLE, y, z);
    return scene;
}

/* Whose the middle of a voxel is. */
static uint8_t label_at(const Options *o, const Scene *scene, int i, int j, int k)
{
    const double at[3] = {(i + 0.5 - 0.5 * o->size[0]) * o->spacing_mm[0],
                          (j + 0.5 - 0.5 * o->size[1]) * o->spacing_mm[1],
                          (k + 0.5 - 0.5 * o->size[2]) * o->spacing_mm[2]};
    for (int n = 0; n < scene->n; n++)
        if (inside(scene->shapes[n], at[0], at[1], at[2]))
            return (uint8_t)scene->shapes[n]->label;
    return 0;
}

/* A NIfTI-1 file of bytes, its axes to the right, the front and the head. */
static bool write_labels(const Options *o)
{
    uint8_t head_bytes[352] = {0};
    const int32_t size = 348;
    int16_t dim[8] = {3, 0, 0, 0, 1, 1, 1, 1};
    float pixdim[8] = {1, 0, 0, 0, 1, 1, 1, 1}, rows[3][4] = {{0}};
    const float offset = 352;
    const int16_t type[2] = {2, 8}, forms[2] = {0, 1};
    for (int a = 0; a < 3; a++) {
        const double way = a < 2 ? -1 : 1;
        dim[a + 1] = (int16_t)o->size[a];
        pixdim[a + 1] = (float)o->spacing_mm[a];
        rows[a][a] = (float)(way * o->spacing_mm[a]);
        rows[a][3] = (float)(way * 0.5 * (1 - o->size[a]) * o->spacing_mm[a]);
    }
    memcpy(head_bytes, &size, sizeof size);
    memcpy(head_bytes + 40, dim, sizeof dim);
    memcpy(head_bytes + 70, type, sizeof type);
    memcpy(head_bytes + 76, pixdim, sizeof pixdim);
    memcpy(head_bytes + 108, &offset, sizeof offset);
    memcpy(head_bytes + 252, forms, sizeof forms);
    memcpy(head_bytes + 280, rows, sizeof rows);
    memcpy(head_bytes + 344, "n+1", 4);
    FILE *f = fopen(o->labels, "wb");
    bool good = f && fwrite(head_bytes, sizeof head_bytes, 1, f) == 1;
    for (int k = 0; good && k < o->size[2]; k++)
        for (int j = 0; j < o->size[1]; j++) {
            const Scene scene = row_scene(o, j, k, 0, 1);
            for (int i = 0; i < o->size[0]; i++)
                fputc(label_at(o, &scene, i, j, k), f);
        }
    good = f && !ferror(f) && good;
    return f && !fclose(f) && good;
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
        {"size", required_argument, NULL, 's'},
        {"spacing", required_argument, NULL, 'm'},
        {"tilt-deg", required_argument, NULL, 't'},
        {"table", no_argument, NULL, 'b'},
        {"supersample", required_argument, NULL, 'n'},
        {"soft", required_argument, NULL, 'e'},
        {"body", no_argument, NULL, 'B'},
        {"labels", required_argument, NULL, 'l'},
        {NULL, 0, NULL, 0},
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
        else if (c == 'e')
            good &= sscanf(optarg, "%lf", &o.edge_mm) == 1 && o.edge_mm > 0;
        else if (c == 'b')
            o.with_table = true;
        else if (c == 'B')
            o.is_body = true;
        else if (c == 'l')
            o.labels = optarg;
        else
            good = false;
    }
    for (int a = 0; a < 3; a++)
        good &= o.size[a] >= 1 && o.size[a] <= 4096 && o.spacing_mm[a] > 0;
    if (!good || optind != argc - 1) {
        fputs("usage: phantom [--size NX,NY,NZ] [--spacing X,Y,Z] [--tilt-deg A] [--supersample N] [--soft MM]\n"
              "    [--table] [--body] [--labels NIFTI] FILE\n",
              stderr);
        return 2;
    }
    o.file = argv[optind];
    make_body(o.body);
    if (o.labels && !write_labels(&o)) {
        fprintf(stderr, "phantom: %s: cannot be written\n", o.labels);
        return 1;
    }
    return write_volume(&o);
}
