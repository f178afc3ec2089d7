/* A rendered picture in display values. */
#pragma once

#include "ctsplat/preset.h"
#include "ctsplat/status.h"
#include <stdbool.h>
#include <stddef.h>

CTS_API_BEGIN

/* Description of a picture that exporters write beside the pixels. Contains no patient data. */
typedef struct CtsPictureInfo {
    char preset[64];
    char engine[16];
    CtsMode mode;
    double azimuth_deg, elevation_deg;
    double mm_per_pixel;
    double window_low_hu, window_high_hu; /* grey pictures: HU shown as black and white */
    /* The camera: unit vectors and the picture's centre, patient coordinates (LPS, mm). */
    double right_lps[3], up_lps[3], forward_lps[3], centre_lps[3];
    bool grey; /* no pixel can have a colour: preset, background and all labels are grey, or it is a projection */
    bool light_behind; /* the background is nearer to white than to black */
    bool shows_skin;   /* skin may be visible: a face may be recognised */
    bool annotated;    /* marks are drawn on it */
    bool is_section;   /* nothing is rendered: a section of the scan, or several */
    double camera_mm;  /* distance of the camera plane, where depth is 0, in front of centre_lps */
    char tiles[256];   /* of a montage, with preset and view of each: "skin left, axial"; "": one view */
    double occlusion;  /* darkening of folds, 0 to 1; 0 where the picture is not lit */
} CtsPictureInfo;

/* n_channels 4: premultiplied red, green, blue and alpha; 1: grey without alpha (mip, minip, average).
 * Row 0 is the top. Values 0..1, not clamped (a specular highlight may pass 1).
 * A band holds some rows of a larger picture: its row 0 is row first_row of whole_height. Bands but the last hold a
 * multiple of CTS_BAND_ROWS rows. A whole picture has first_row 0 and whole_height as height. */
enum { CTS_BAND_ROWS = 64 };

typedef struct CtsPicture {
    int width, height, n_channels;
    int first_row, whole_height;
    float *pixels;
    float *depth_mm; /* distance of the first visible surface from the camera plane (the plane through the nearest
                        corner of the volume's bounding sphere) along the view; +inf where empty; may be NULL */
    /* upper limit of each pixel's error, rms over red, green and blue, as estimated by the engine; of an interpolated
     * pixel an estimate; 0: re-rendered at reference precision. NULL: the engine has none */
    float *bound;
    bool has_alpha; /* false once blended over a background: alpha is then 1 everywhere */
    CtsPictureInfo info;
} CtsPicture;

/* All zeros; has_alpha is true for 4 channels. CTS_ERR_USAGE for sizes outside 1..32768. */
CtsStatus cts_picture_new(CtsPicture **picture, int width, int height, int n_channels, CtsError *err);
void cts_picture_free(CtsPicture **picture);

/* Blend over a colour (display values): alpha becomes 1, has_alpha false. For n_channels 4 only. n_threads 0: all
 * cores. */
void cts_picture_over(CtsPicture *picture, const double background[3], int n_threads);

typedef struct CtsDifference {
    double rmse, psnr_db; /* psnr_db is INFINITY for equal pictures */
    double ssim;          /* Gaussian windows of 11x11 pixels, sigma 1.5, mean of red, green and blue */
    double p999;          /* 99.9th percentile of the samples' differences */
    double max;
    double share; /* of pixels that differ by more than 1/255 in a channel */
    bool equal;   /* to the bit: not clamped, with alpha, and with depth where both have it */
} CtsDifference;

/* Over display values 0..1 (clamped) of red, green and blue. CTS_ERR_USAGE when the sizes differ. */
CtsStatus cts_picture_compare(const CtsPicture *a, const CtsPicture *b, CtsDifference *difference, CtsError *err);

CTS_API_END
