#include "base/load_plugin.h"

#include "base/libexec.h"
#include <dlfcn.h>
#include <errno.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* Candidates relative to the library's folder: the build folder, then the installed folders. */
static const char *const PLACES[] = {"", "cli/", "ctsplat/", "../" CTS_LIBDIR "/ctsplat/"};
enum { N_PLACES = sizeof PLACES / sizeof *PLACES };

static CtsStatus open_plugin(const char *file, void **plugin, CtsError *err)
{
    char folder[PATH_MAX];
    *plugin = NULL;
    if (!cts_program_folder(folder))
        return cts_fail(err, CTS_ERR_INTERNAL, "%s: where it should be is not known: %s", file, strerror(errno));
    for (int i = 0; i < N_PLACES; i++) {
        char *path;
        if (asprintf(&path, "%s%s%s", folder, PLACES[i], file) < 0)
            return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        const bool exists = !access(path, F_OK);
        *plugin = exists ? dlopen(path, RTLD_NOW | RTLD_LOCAL) : NULL;
        free(path);
        if (exists)
            return *plugin ? CTS_OK : cts_fail(err, CTS_ERR_INTERNAL, "%s cannot be loaded: %s", file, dlerror());
    }
    return cts_fail(err, CTS_ERR_INTERNAL, "%s is not where it was installed", file);
}

/* The state of this file. */
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;

static void take_lock(void)
{
    pthread_mutex_lock(&lock);
}

static void leave_lock(void)
{
    pthread_mutex_unlock(&lock);
}

static void mind_loader_forks(void)
{
    pthread_atfork(take_lock, leave_lock, leave_lock);
}

static CtsStatus load_table(const char *file, const char *name, const void **table, CtsError *err)
{
    void *plugin;
    const void *(*get_table)(void);
    const CtsStatus st = open_plugin(file, &plugin, err);
    void *const symbol = st ? NULL : dlsym(plugin, name);
    memcpy(&get_table, &symbol, sizeof get_table);
    if (st)
        return st;
    if (!get_table)
        return cts_fail(err, CTS_ERR_INTERNAL, "%s belongs to another version of ctsplat (reinstall it)", file);
    *table = get_table();
    return CTS_OK;
}

CtsStatus cts_plugin_table(const char *file, const char *name, const void **kept, const void **table, CtsError *err)
{
    static pthread_once_t once = PTHREAD_ONCE_INIT;
    pthread_once(&once, mind_loader_forks);
    take_lock();
    const CtsStatus st = *kept ? CTS_OK : load_table(file, name, kept, err);
    *table = *kept;
    leave_lock();
    return st;
}
