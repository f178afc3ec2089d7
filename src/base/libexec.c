#include "base/libexec.h"

#include <dlfcn.h>
#include <errno.h>
#include <link.h>
#include <signal.h>
#include <spawn.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/auxv.h>
#include <sys/statvfs.h>
#include <unistd.h>

/* Candidates relative to the folder of the program or the library: the build folder, a wheel, the installed folders. */
static const char *const PLACES[] = {"", "cli/", "ctsplat/", CTS_LIBEXEC_FROM_BIN, CTS_LIBEXEC_FROM_LIB};
enum { N_PLACES = sizeof PLACES / sizeof *PLACES };

/* The folder of the program or the shared library that contains this code, with a slash behind it. Without /proc the
 * program's path is the one that it was started by. */
static bool program_folder(char folder[PATH_MAX])
{
    Dl_info info;
    struct link_map *here;
    if (!dladdr1(PLACES, &info, (void **)&here, RTLD_DL_LINKMAP))
        return false;
    const char *const started_by = (const char *)getauxval(AT_EXECFN);
    if (!realpath(*here->l_name ? here->l_name : "/proc/self/exe", folder) &&
        (*here->l_name || !started_by || !realpath(started_by, folder)))
        return false;
    strrchr(folder, '/')[1] = 0;
    return true;
}

static bool exists_in(const char *folder, const char *place, const char *program, char path[PATH_MAX])
{
    const int n = snprintf(path, PATH_MAX, "%s%s%s", folder, place, program);
    return n > 0 && n < PATH_MAX && !access(path, F_OK);
}

CtsStatus cts_libexec_find(const char *program, char path[PATH_MAX], CtsError *err)
{
    const char *const chosen = secure_getenv("CTSPLAT_LIBEXEC");
    char folder[PATH_MAX];
    if (chosen && *chosen)
        return exists_in(chosen, "/", program, path)
                   ? CTS_OK
                   : cts_fail(err, CTS_ERR_INTERNAL, "%s is not in the folder of CTSPLAT_LIBEXEC, %s", program, chosen);
    if (program_folder(folder))
        for (int i = 0; i < N_PLACES; i++)
            if (exists_in(folder, PLACES[i], program, path))
                return CTS_OK;
    return cts_fail(err, CTS_ERR_INTERNAL,
                    "%s is not where it was installed (reinstall ctsplat, or set CTSPLAT_LIBEXEC to its folder)",
                    program);
}

static CtsStatus report_start(const char *path, int why, CtsError *err)
{
    struct statvfs system;
    if (why == EACCES && !statvfs(path, &system) && system.f_flag & ST_NOEXEC)
        return cts_fail(err, CTS_ERR_INTERNAL,
                        "%s cannot be started: its file system is mounted noexec (copy it to another folder, and set "
                        "CTSPLAT_LIBEXEC to that)",
                        path);
    return cts_fail(err, why == ENOMEM || why == EAGAIN ? CTS_ERR_MEMORY : CTS_ERR_INTERNAL, "%s cannot be started: %s",
                    path, strerror(why));
}

CtsStatus cts_program_start(const char *const *arguments, const int *descriptors, const int *as, int n, pid_t *pid,
                            CtsError *err)
{
    posix_spawn_file_actions_t files;
    posix_spawnattr_t attributes;
    sigset_t all;
    sigfillset(&all);
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
    posix_spawnattr_setsigmask(&attributes, &all);
    int why = posix_spawn_file_actions_init(&files);
    for (int i = 0; !why && i < n; i++)
        why = posix_spawn_file_actions_adddup2(&files, descriptors[i], as[i]); /* not closed at the start */
    if (!why)
        why = posix_spawnp(pid, arguments[0], &files, &attributes, (char *const *)(uintptr_t)arguments, environ);
    posix_spawn_file_actions_destroy(&files);
    posix_spawnattr_destroy(&attributes);
    return why ? report_start(arguments[0], why, err) : CTS_OK;
}

CtsStatus cts_libexec_start(const char *program, const char *argument, const int *descriptors, int n, pid_t *pid,
                            CtsError *err)
{
    char path[PATH_MAX];
    const CtsStatus st = cts_libexec_find(program, path, err);
    return st ? st
              : cts_program_start((const char *const[]){path, argument, NULL}, descriptors, descriptors, n, pid, err);
}

CtsStatus cts_libexec_become(const char *program, const char *const *arguments, CtsError *err)
{
    char path[PATH_MAX];
    const CtsStatus st = cts_libexec_find(program, path, err);
    if (!st)
        execv(path, (char *const *)(uintptr_t)arguments);
    return st ? st : report_start(path, errno, err);
}
