#include "base/file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

enum { WRITE_BEHIND = 256 << 10 };

struct CtsTempFile {
    int fd;
    char *target;     /* the final name */
    char *path;       /* the temporary one */
    char *folder;     /* of both */
    bool is_unsynced; /* need not survive a power cut */
    bool is_private;  /* not for others */
    size_t n_waiting; /* bytes not yet submitted to the disk */
};

/* The folder part of path, "." if it has none; NULL without memory. */
static char *folder_of(const char *path)
{
    const char *slash = strrchr(path, '/');
    if (!slash)
        return strdup(".");
    return slash == path ? strdup("/") : strndup(path, (size_t)(slash - path));
}

static CtsStatus fail_errno(CtsError *err, const char *path, const char *what)
{
    const int e = errno;
    return cts_fail(err, CTS_ERR_OUTPUT, "%s: %s: %s%s", path, what, strerror(e),
                    e == ENOSPC || e == EDQUOT ? " (free some space, or choose another folder)" : "");
}

static void free_temp(CtsTempFile **temp)
{
    CtsTempFile *t = *temp;
    if (t) {
        free(t->target);
        free(t->path);
        free(t->folder);
    }
    free(t);
    *temp = NULL;
}

CtsStatus cts_temp_open(CtsTempFile **temp, const char *path, CtsError *err)
{
    const char *base = strrchr(path, '/') ? strrchr(path, '/') + 1 : path;
    CtsTempFile *t = *temp = calloc(1, sizeof *t);
    if (!t || !(t->folder = folder_of(path)) || !(t->target = strdup(path)) ||
        asprintf(&t->path, "%s/.%.100s.%ld.XXXXXX.tmp", t->folder, base, (long)getpid()) < 0) {
        if (t)
            t->path = NULL; /* asprintf() leaves it undefined on failure */
        free_temp(temp);
        return cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", path);
    }
    t->fd = mkostemps(t->path, 4, O_CLOEXEC);
    if (t->fd < 0) {
        const CtsStatus st = fail_errno(err, path, "cannot be created");
        free_temp(temp);
        return st;
    }
    return CTS_OK;
}

bool cts_write_all(int fd, const void *data, size_t n)
{
    const char *p = data;
    for (ssize_t done; n > 0; p += done, n -= (size_t)done)
        if ((done = TEMP_FAILURE_RETRY(write(fd, p, n))) < 0)
            return false;
    return true;
}

bool cts_send_all(int socket, const void *data, size_t n)
{
    const char *p = data;
    for (ssize_t done; n > 0; p += done, n -= (size_t)done)
        if ((done = TEMP_FAILURE_RETRY(send(socket, p, n, MSG_NOSIGNAL))) < 0)
            return false;
    return true;
}

CtsStatus cts_temp_write(CtsTempFile *temp, const void *data, size_t n, CtsError *err)
{
    if (!cts_write_all(temp->fd, data, n))
        return fail_errno(err, temp->target, "cannot be written");
    temp->n_waiting += n;
    /* Start writing to the disk early, so that the sync at the end is short; only a hint. */
    if (temp->n_waiting >= WRITE_BEHIND && !temp->is_unsynced) {
        sync_file_range(temp->fd, 0, 0, SYNC_FILE_RANGE_WRITE);
        temp->n_waiting = 0;
    }
    return CTS_OK;
}

CtsStatus cts_temp_write_at(CtsTempFile *temp, const void *data, size_t n, uint64_t offset, CtsError *err)
{
    const char *p = data;
    for (ssize_t done; n > 0; p += done, n -= (size_t)done, offset += (uint64_t)done)
        if ((done = TEMP_FAILURE_RETRY(pwrite(temp->fd, p, n, (off_t)offset))) < 0)
            return fail_errno(err, temp->target, "cannot be written");
    return CTS_OK;
}

const char *cts_temp_path(const CtsTempFile *temp)
{
    return temp->path;
}

int cts_temp_fd(const CtsTempFile *temp)
{
    return temp->fd;
}

static mode_t current_umask(void)
{
    const mode_t mask = umask(077);
    umask(mask);
    return mask;
}

static void sync_folder(const char *folder)
{
    const int fd = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd >= 0) {
        fsync(fd); /* some file systems cannot; the rename has happened all the same */
        close(fd);
    }
}

bool cts_sync_file(int fd)
{
    return !fsync(fd) || errno == EINVAL || errno == ENOSYS || errno == EOPNOTSUPP;
}

bool cts_rename_new(const char *from, const char *to)
{
    struct stat info;
    if (!renameat2(AT_FDCWD, from, AT_FDCWD, to, RENAME_NOREPLACE))
        return true;
    if (errno == EEXIST)
        return false;
    if (!link(from, to))
        return unlink(from), true;
    if (errno != EEXIST && lstat(to, &info))
        return !rename(from, to);
    errno = EEXIST;
    return false;
}

CtsStatus cts_temp_commit(CtsTempFile **temp, bool force, uint64_t *bytes, CtsError *err)
{
    CtsTempFile *t = *temp;
    CtsStatus st = CTS_OK;
    struct stat info;
    /* The mode is left as it is where the file system has one for all files, as CIFS, which answers EPERM. */
    if (fchmod(t->fd, (t->is_private ? 0640 : 0666) & ~current_umask())) {
    }
    if (fstat(t->fd, &info) || (!t->is_unsynced && !cts_sync_file(t->fd)))
        st = fail_errno(err, t->target, "cannot be written");
    const int closed = close(t->fd);
    t->fd = -1;
    if (!st && closed)
        st = fail_errno(err, t->target, "cannot be written");
    if (!st && !(force ? !rename(t->path, t->target) : cts_rename_new(t->path, t->target)))
        st = errno == EEXIST ? cts_fail(err, CTS_ERR_OUTPUT, "%s: exists (`force` overwrites it)", t->target)
                             : fail_errno(err, t->target, "cannot be renamed into place");
    if (!st) {
        if (bytes)
            *bytes = (uint64_t)info.st_size;
        if (!t->is_unsynced)
            sync_folder(t->folder);
        free_temp(temp);
        return CTS_OK;
    }
    cts_temp_discard(temp);
    return st;
}

void cts_temp_do_not_sync(CtsTempFile *temp)
{
    temp->is_unsynced = true;
}

void cts_temp_keep_private(CtsTempFile *temp)
{
    temp->is_private = true;
}

void cts_temp_discard(CtsTempFile **temp)
{
    CtsTempFile *t = *temp;
    if (!t)
        return;
    if (t->fd >= 0)
        close(t->fd);
    unlink(t->path);
    free_temp(temp);
}

const char *cts_temp_root(void)
{
    const char *folder = getenv("TMPDIR");
    return folder && *folder == '/' ? folder : "/tmp";
}

CtsStatus cts_temp_folder(const char *prefix, char **folder, CtsError *err)
{
    CtsStatus st = CTS_OK;
    if (asprintf(folder, "%s/%sXXXXXX", cts_temp_root(), prefix) < 0) {
        *folder = NULL;
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    }
    if (!mkdtemp(*folder)) {
        st = cts_fail(err, CTS_ERR_OUTPUT, "%s: cannot be made: %s (set TMPDIR to a folder with room)", *folder,
                      strerror(errno));
        free(*folder);
        *folder = NULL;
    }
    return st;
}

bool cts_user_path(char *path, size_t size, const char *variable, const char *fallback, const char *name, bool made)
{
    const char *folder = getenv(variable), *home = getenv("HOME");
    int n = -1;
    /* A relative folder must be ignored. */
    if (folder && *folder == '/')
        n = snprintf(path, size, "%s/ctsplat/%s", folder, name);
    else if (home && *home == '/')
        n = snprintf(path, size, "%s/%s/ctsplat/%s", home, fallback, name);
    const bool is_known = n > 0 && n < (int)size;
    for (char *slash = path; made && is_known && (slash = strchr(slash + 1, '/'));) {
        *slash = 0;
        mkdir(path, 0700);
        *slash = '/';
    }
    return is_known;
}

CtsStatus cts_file_text(const char *path, size_t most, CtsStatus fault, char **text, size_t *n, CtsError *err)
{
    FILE *const file = fopen(path, "rbe");
    *text = file ? malloc(most + 2) : NULL;
    *n = *text ? fread(*text, 1, most + 1, file) : 0;
    const bool good = *text && !ferror(file);
    if (!good)
        cts_fail(err, fault, "%s: %s", path, strerror(errno));
    else
        (*text)[*n] = 0;
    if (file)
        fclose(file);
    return good ? CTS_OK : fault;
}

CtsStatus cts_file_check_writable(const char *path, bool force, CtsError *err)
{
    struct stat info;
    char *folder = folder_of(path);
    CtsStatus st = CTS_OK;
    if (!folder)
        return cts_fail(err, CTS_ERR_MEMORY, "%s: out of memory", path);
    if (stat(folder, &info) || !S_ISDIR(info.st_mode))
        st = cts_fail(err, CTS_ERR_OUTPUT, "%s: its folder does not exist (make it first)", path);
    else if (access(folder, W_OK | X_OK))
        st = cts_fail(err, CTS_ERR_OUTPUT, "%s: its folder cannot be written (%s)", path, strerror(errno));
    else if (lstat(path, &info) == 0 && !force)
        st = cts_fail(err, CTS_ERR_OUTPUT, "%s: exists (`force` overwrites it)", path);
    else if (stat(path, &info) == 0 && !S_ISREG(info.st_mode))
        st = cts_fail(err, CTS_ERR_OUTPUT, "%s: is not a regular file", path);
    free(folder);
    return st;
}
