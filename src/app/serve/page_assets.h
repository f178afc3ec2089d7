/* The files of the page, put into C by page/embed_assets.py. */
#ifndef CTS_SERVE_PAGE_H
#define CTS_SERVE_PAGE_H

#include <stddef.h>

typedef struct CtsPageAsset {
    const char *name; /* below the server's root; "" is the page itself */
    const char *media_type;
    const unsigned char *bytes;
    size_t n_bytes;
} CtsPageAsset;

extern const CtsPageAsset cts_page_assets[];
extern const size_t cts_page_n_assets;

#endif
