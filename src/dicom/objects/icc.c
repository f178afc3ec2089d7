#include "dicom/objects/objects.h"

#include <math.h>
#include <string.h>

typedef struct Profile {
    uint8_t *bytes;
    size_t n;
} Profile;

static void put32(Profile *p, uint32_t value)
{
    for (int shift = 24; shift >= 0; shift -= 8)
        p->bytes[p->n++] = (uint8_t)(value >> shift);
}

static void put_name(Profile *p, const char name[4])
{
    memcpy(p->bytes + p->n, name, 4);
    p->n += 4;
}

/* s15Fixed16Number */
static void put_fixed(Profile *p, const double *values, int n)
{
    for (int i = 0; i < n; i++)
        put32(p, (uint32_t)(int32_t)lround(values[i] * 65536));
}

/* multiLocalizedUnicodeType with one English text */
static void put_text(Profile *p, const char *text)
{
    const size_t n = strlen(text);
    put_name(p, "mluc");
    put32(p, 0);
    put32(p, 1);
    put32(p, 12);
    put_name(p, "enUS");
    put32(p, (uint32_t)(2 * n));
    put32(p, 28);
    for (size_t i = 0; i < n; i++) {
        p->bytes[p->n++] = 0;
        p->bytes[p->n++] = (uint8_t)text[i];
    }
    while (p->n % 4)
        p->bytes[p->n++] = 0;
}

static void put_xyz(Profile *p, const double xyz[3])
{
    put_name(p, "XYZ ");
    put32(p, 0);
    put_fixed(p, xyz, 3);
}

/* D50, the white point of profiles, and sRGB's primaries (IEC 61966-2-1) adapted to it from D65 by Bradford's method,
 * whose matrix is `adaptation`. */
static const double d50[3] = {0.96420288, 1, 0.82490540};
static const double primaries[3][3] = {
    {0.4360747, 0.2225045, 0.0139322},
    {0.3850649, 0.7168786, 0.0971045},
    {0.1430804, 0.0606169, 0.7141733},
};
static const double adaptation[9] = {1.0478112,  0.0228866,  -0.0501270, 0.0295424, 0.9904844,
                                     -0.0170491, -0.0092345, 0.0150436,  0.7521316};
/* ((a x + b)^g from d on, c x below: g a b c d */
static const double curve[5] = {2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045};

static void put_header(Profile *p)
{
    put32(p, 0); /* the length, filled in at the end */
    put32(p, 0);
    put32(p, 0x04300000);
    put_name(p, "scnr");
    put_name(p, "RGB ");
    put_name(p, "XYZ ");
    put32(p, 2026 << 16 | 1); /* made: year, month, day, hour, minute, second */
    put32(p, 1 << 16);
    put32(p, 0);
    put_name(p, "acsp");
    p->n += 28; /* platform, flags, device, attributes, intent: 0 */
    put_fixed(p, d50, 3);
    p->n += 48; /* creator, checksum, reserved */
}

size_t cts_icc_srgb(uint8_t profile[CTS_ICC_BYTES])
{
    static const char names[10][5] = {"desc", "cprt", "wtpt", "chad", "rXYZ", "gXYZ", "bXYZ", "rTRC", "gTRC", "bTRC"};
    enum { N_TAGS = 10, TABLE = 132 }; /* TABLE: the header's 128 bytes and the count */
    Profile p = {profile, 0};
    size_t start[N_TAGS], end[N_TAGS];
    memset(profile, 0, CTS_ICC_BYTES);
    put_header(&p);
    p.n = TABLE + 12 * N_TAGS;
    for (int i = 0; i < N_TAGS; i++) {
        start[i] = i > 7 ? start[7] : p.n; /* one curve for all three colours */
        if (i == 0)
            put_text(&p, "sRGB");
        else if (i == 1)
            put_text(&p, "No copyright, use freely");
        else if (i == 2)
            put_xyz(&p, d50);
        else if (i == 3) {
            put_name(&p, "sf32");
            put32(&p, 0);
            put_fixed(&p, adaptation, 9);
        } else if (i < 7)
            put_xyz(&p, primaries[i - 4]);
        else if (i == 7) {
            put_name(&p, "para");
            put32(&p, 0);
            put32(&p, 3 << 16);
            put_fixed(&p, curve, 5);
        }
        end[i] = p.n;
    }
    const size_t n = p.n;
    p.n = 0;
    put32(&p, (uint32_t)n);
    p.n = TABLE - 4;
    put32(&p, N_TAGS);
    for (int i = 0; i < N_TAGS; i++) {
        put_name(&p, names[i]);
        put32(&p, (uint32_t)start[i]);
        put32(&p, (uint32_t)(end[i] - start[i]));
    }
    return n;
}
