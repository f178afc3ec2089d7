/* High-throughput JPEG 2000 (Rec. ITU-T T.814), by OpenJPH. That library fills its tables whenever it is loaded, which
 * takes as long as a fifth of a small run; so it is in a library of its own, and comes with the first such slice. */
#ifndef CTS_DICOM_HTJ2K_H
#define CTS_DICOM_HTJ2K_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { CTS_HTJ2K_MAX_COMPONENTS = 4 };

typedef struct CtsHtj2kShape {
    unsigned columns, rows, n_components;
    int plain; /* every sample is there, and the picture begins at 0 */
    struct {
        int precision, is_signed;
    } components[CTS_HTJ2K_MAX_COMPONENTS];
} CtsHtj2kShape;

/* Who takes the picture; both end the decoding by 0. */
typedef struct CtsHtj2kTaker {
    void *context;
    int (*shape)(void *context, const CtsHtj2kShape *shape); /* once, before anything is allocated by it */
    int (*line)(void *context, unsigned component, unsigned row, const int32_t *samples);
} CtsHtj2kTaker;

typedef enum CtsHtj2kEnd { CTS_HTJ2K_DONE, CTS_HTJ2K_ENDED, CTS_HTJ2K_DAMAGED, CTS_HTJ2K_NO_MEMORY } CtsHtj2kEnd;

/* What the library exports as cts_htj2k_run. It knows nothing of the program; why is filled when damaged. */
typedef CtsHtj2kEnd (*cts_htj2k_fn)(const uint8_t *stream, size_t n, const CtsHtj2kTaker *taker, char why[120]);

#ifdef __cplusplus
}
#endif
#endif
