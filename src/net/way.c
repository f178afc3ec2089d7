#define _GNU_SOURCE
/* The library of the ways, found beside the object that this code is in: where it was built, or installed. */
#include "dicom/dcm_read.h"
#include "net/peer.h"

#include <dlfcn.h>
#include <errno.h>
#include <limits.h>
#include <link.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static const char *const PLACES[] = {"", "ctsplat/", "../" CTS_LIBDIR "/ctsplat/"};
enum { N_PLACES = sizeof PLACES / sizeof *PLACES };

/* The folder of the program, or of the shared library, with a slash behind it. */
static bool find_folder(char folder[PATH_MAX])
{
    Dl_info info;
    struct link_map *here;
    if (!dladdr1(PLACES, &info, (void **)&here, RTLD_DL_LINKMAP) ||
        !realpath(*here->l_name ? here->l_name : "/proc/self/exe", folder))
        return false;
    strrchr(folder, '/')[1] = 0;
    return true;
}

static CtsStatus load(void **part, CtsError *err)
{
    char folder[PATH_MAX];
    *part = NULL;
    if (!find_folder(folder))
        return cts_fail(err, CTS_ERR_INTERNAL, CTS_NET_PART ": where it should be is not known: %s", strerror(errno));
    for (int i = 0; i < N_PLACES; i++) {
        char *path;
        if (asprintf(&path, "%s%s" CTS_NET_PART, folder, PLACES[i]) < 0)
            return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        const bool exists = !access(path, F_OK);
        *part = exists ? dlopen(path, RTLD_NOW | RTLD_LOCAL) : NULL;
        free(path);
        if (exists)
            return *part ? CTS_OK
                         : cts_fail(err, CTS_ERR_INTERNAL, "what talks to a PACS cannot be loaded: %s", dlerror());
    }
    return cts_fail(err, CTS_ERR_INTERNAL, CTS_NET_PART ", which talks to a PACS, is not where it was installed");
}

CtsStatus cts_way_find(const CtsPeer *peer, const CtsWay **way, CtsError *err)
{
    void *part;
    cts_net_way_fn find;
    CtsStatus st;
    if ((st = load(&part, err)) || (st = cts_dcm_start(err)))
        return st;
    void *symbol = dlsym(part, "cts_net_way");
    if (!symbol)
        return cts_fail(err, CTS_ERR_INTERNAL, "%s is of another program (install it anew)", CTS_NET_PART);
    memcpy(&find, &symbol, sizeof find);
    *way = find(peer->web);
    return CTS_OK;
}
