/* Preloaded into the program under test: a file system that lacks the calls named in CTS_LACKS (fchmod, renameat2,
 * link, fsync, flock); flock fails with the errno CTS_FLOCK_ERRNO. */
#include <dlfcn.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/types.h>

int flock(int fd, int how);
int fsync(int fd);
int link(const char *from, const char *to);
int renameat2(int from_fd, const char *from, int to_fd, const char *to, unsigned flags);

static int lacks(const char *call, int error)
{
    const char *const all = getenv("CTS_LACKS");
    errno = error;
    return all && strstr(all, call) != NULL;
}

#define NEXT(type, name) ((type)dlsym(RTLD_NEXT, name))

int fchmod(int fd, mode_t mode)
{
    return lacks("fchmod", EPERM) ? -1 : NEXT(int (*)(int, mode_t), "fchmod")(fd, mode);
}

int fsync(int fd)
{
    return lacks("fsync", EINVAL) ? -1 : NEXT(int (*)(int), "fsync")(fd);
}

int link(const char *from, const char *to)
{
    return lacks("link", EPERM) ? -1 : NEXT(int (*)(const char *, const char *), "link")(from, to);
}

int renameat2(int from_fd, const char *from, int to_fd, const char *to, unsigned flags)
{
    typedef int (*rename_fn)(int, const char *, int, const char *, unsigned);
    return lacks("renameat2", EINVAL) && flags ? -1 : NEXT(rename_fn, "renameat2")(from_fd, from, to_fd, to, flags);
}

int flock(int fd, int how)
{
    const char *const error = getenv("CTS_FLOCK_ERRNO");
    return lacks("flock", error ? atoi(error) : ENOSYS) ? -1 : NEXT(int (*)(int, int), "flock")(fd, how);
}
