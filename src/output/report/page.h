/* Parts of HTML pages that stand by themselves. */
#ifndef CTS_REPORT_PAGE_H
#define CTS_REPORT_PAGE_H

#include "ctsplat/status.h"
#include <stdint.h>
#include <stdio.h>

/* Text with < > & and quotes written as entities. */
void cts_page_text(FILE *file, const char *text);

/* A picture of 8-bit red, green, blue as "data:image/png;base64,...". */
CtsStatus cts_page_image(FILE *file, const uint8_t *rgb, int width, int height, CtsError *err);

#endif
