/* Volumes that stay loaded, and pictures of them for whoever asks over HTTP: PS3.18 rendered3D, ctsplat's own words,
 * and a page. */
#ifndef CTS_SERVE_SERVE_H
#define CTS_SERVE_SERVE_H

#include "app/words/options.h"
#include <signal.h>

/* What the caller is told; text is one line. */
typedef struct CtsServeTold {
    void (*ready)(const char *url); /* where to find the page, its token in it where nobody else knows it */
    void (*note)(const char *text);
} CtsServeTold;

/* Serves until *stop, or a signal that sets it, says so; requests under way are then answered with 503. Options are
 * those of the command `serve`. */
CtsStatus cts_serve(const CtsOptions *options, const volatile sig_atomic_t *stop, const CtsServeTold *told,
                    CtsError *err);

#endif
