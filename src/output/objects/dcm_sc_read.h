/* The parts of reading a secondary capture that need DCMTK. All calls are thread-safe. */
#ifndef CTS_DICOM_DCM_SC_READ_H
#define CTS_DICOM_DCM_SC_READ_H

#include "ctsplat/status.h"
#include "input/files/syntax.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct CtsScHeader {
    int width, height, n_frames;
    int n_samples;      /* 1 or 3 */
    int bits_allocated; /* 8 or 16 */
    int bits_stored;
    bool planar;   /* all red, then all green, then all blue */
    bool inverted; /* MONOCHROME1 */
} CtsScHeader;

/* The image description of a data set that ends before its pixels. CTS_ERR_READ for pixels of another kind than
 * unsigned RGB of 8 bits or grey of up to 16. */
CtsStatus cts_dcm_sc_header(const uint8_t *data_set, size_t n, const CtsSyntax *native, CtsScHeader *header,
                            CtsError *err);

#ifdef __cplusplus
}
#endif
#endif
