#include "output/image/samples.h"

double cts_srgb_to_linear(double display)
{
    if (!(display > 0))
        return 0;
    return display <= 0.04045 ? display / 12.92 : pow((display + 0.055) / 1.055, 2.4);
}

double cts_linear_to_srgb(double linear)
{
    if (!(linear > 0))
        return 0;
    return linear <= 0.0031308 ? linear * 12.92 : 1.055 * pow(linear, 1 / 2.4) - 0.055;
}

bool cts_picture_is_grey(const CtsPicture *picture)
{
    if (picture->n_channels == 1)
        return true;
    const size_t n = (size_t)picture->width * picture->height;
    for (size_t i = 0; i < n; i++) {
        const float *p = picture->pixels + 4 * i;
        if (p[0] != p[1] || p[1] != p[2])
            return false;
    }
    return true;
}

static void straight_pixel(const float *p, uint16_t *out)
{
    const uint16_t alpha = cts_round16(p[3]);
    for (int c = 0; c < 3; c++)
        out[c] = alpha ? cts_round16((double)p[c] / p[3]) : 0;
    out[3] = alpha;
}

void cts_samples_row16(const CtsPicture *picture, int y, int n_samples, uint16_t *row)
{
    const int channels = picture->n_channels;
    const float *p = picture->pixels + (size_t)y * picture->width * channels;
    /* The picture of most files, written out: its loop has no branches but those of the rounding. */
    if (n_samples == 3 && channels == 4) {
        for (int x = 0; x < picture->width; x++)
            for (int c = 0; c < 3; c++)
                row[3 * x + c] = cts_round16(p[4 * x + c]);
        return;
    }
    for (int x = 0; x < picture->width; x++, p += channels, row += n_samples) {
        if (n_samples == 4 && channels == 4) {
            straight_pixel(p, row);
            continue;
        }
        for (int c = 0; c < n_samples; c++)
            row[c] = c == 3 ? 65535 : cts_round16(channels == 4 ? p[c] : p[0]);
    }
}

void cts_samples_row8(const CtsPicture *picture, int y, int n_samples, uint8_t *row)
{
    const int channels = picture->n_channels;
    const float *p = picture->pixels + (size_t)y * picture->width * channels;
    if (channels == 4 && (n_samples == 3 || (n_samples == 4 && !picture->has_alpha))) {
        for (int x = 0; x < picture->width; x++, p += channels, row += n_samples) {
            for (int c = 0; c < 3; c++)
                row[c] = cts_round8(p[c]);
            row[n_samples - 1] = n_samples == 4 ? UINT8_MAX : row[2];
        }
        return;
    }
    for (int x = 0; x < picture->width; x++, p += channels, row += n_samples) {
        const bool straight = n_samples == 4 && channels == 4;
        const double alpha = straight ? p[3] : 1;
        const bool visible = cts_round8(alpha) > 0;
        for (int c = 0; c < n_samples && c < 3; c++)
            row[c] = visible ? cts_round8((channels == 4 ? p[c] : p[0]) / alpha) : 0;
        if (n_samples == 4)
            row[3] = cts_round8(alpha);
    }
}
