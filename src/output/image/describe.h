/* Description of a picture in words and numbers for files: without patient data, the same in every locale. */
#pragma once

#include "ctsplat/picture.h"

typedef struct CtsPhrase {
    char text[80];
} CtsPhrase;

/* Up to n_digits significant digits with a decimal point in every locale. */
CtsPhrase cts_describe_number(double value, int n_digits);

/* The view in the notation of --view: a name if it has one, else "azimuth,elevation" in degrees; "several" of a
 * montage. */
CtsPhrase cts_describe_view(const CtsPictureInfo *info);

/* The program, preset and view, or the tiles of a montage, as a comment in a file. */
enum { CTS_DESCRIPTION = 400 };
void cts_describe_picture(const CtsPictureInfo *info, char text[CTS_DESCRIPTION]);

/* The letters of a patient direction (LPS): A P L R H F, the strongest component first, further letters for components
 * of more than sin 15 degrees of its length. "" for a zero vector. */
CtsPhrase cts_describe_direction(const double direction_lps[3]);

/* An error estimate as "0.28/255 rms". */
enum { CTS_ERROR_TEXT = 24 };
void cts_describe_error(double rmse, char text[CTS_ERROR_TEXT]);

/* The grey window as "low,high" in HU; "" when the picture is composite. */
CtsPhrase cts_describe_window(const CtsPictureInfo *info);
