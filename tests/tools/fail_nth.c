/* Preloaded into the program under test: one call of the C library fails. CTS_FAIL names the call (malloc, open, read,
 * write, fsync, rename, posix_spawnp, shmget, poll, recv, waitid, getrandom, accept; kill: the
 * process that was started last, when it is sent data) and CTS_FAIL_AT its number, from 1; with CTS_FAIL_ON=1 all later
 * ones fail too. Calls are counted over all threads; child processes do not fail, or with CTS_FAIL_CHILD=1 only they
 * do. When the call was reached, a line is appended to the file CTS_FAIL_MARK. */
#undef _FILE_OFFSET_BITS /* both names of a call are needed: open() and open64() */
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <sys/shm.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

enum Call {
    MALLOC,
    OPEN,
    READ,
    WRITE,
    FSYNC,
    RENAME,
    SPAWN,
    SHMGET,
    KILL,
    POLL,
    RECV,
    WAITID,
    GETRANDOM,
    ACCEPT,
    N_CALLS
};
static const char *const names[N_CALLS] = {"malloc", "open", "read", "write", "fsync",  "rename",    "posix_spawnp",
                                           "shmget", "kill", "poll", "recv",  "waitid", "getrandom", "accept"};
static const int errors[N_CALLS] = {ENOMEM, EMFILE, EIO,    ENOSPC,     EIO,    EACCES, EAGAIN,
                                    ENOMEM, 0,      ENOMEM, ECONNRESET, ECHILD, EAGAIN, EMFILE};

static int chosen = -1;
static long fail_at;
static int fail_on, fail_child;
static pid_t self;
static int is_started; /* by a process under test */
static const char *mark;
static atomic_long seen;
static pid_t child; /* that was started last */
static _Thread_local int loading;

/* Calls fail only inside main(): the loader and the libraries before and after it are not under test, nor is the
 * loading of a library in main(): an exception in the constructor of a library's static object ends the program. */
static void choose(void)
{
    const char *call = getenv("CTS_FAIL"), *at = getenv("CTS_FAIL_AT");
    self = getpid();
    is_started = getenv("CTS_FAIL_STARTED") != NULL;
    if (call)
        setenv("CTS_FAIL_STARTED", "1", 1);
    mark = getenv("CTS_FAIL_MARK");
    fail_on = getenv("CTS_FAIL_ON") != NULL;
    fail_child = getenv("CTS_FAIL_CHILD") != NULL;
    fail_at = at ? atol(at) : 0;
    for (int c = 0; call && c < N_CALLS; c++)
        if (strcmp(names[c], call) == 0)
            chosen = c;
}

static int (*real_main)(int, char **, char **);

static int watched_main(int argc, char **argv, char **environment)
{
    choose();
    const int code = real_main(argc, argv, environment);
    chosen = -1;
    return code;
}

typedef int (*start_fn)(int (*)(int, char **, char **), int, char **, void (*)(void), void (*)(void), void (*)(void),
                        void *);
int __libc_start_main(int (*main)(int, char **, char **), int argc, char **argv, void (*init)(void), void (*fini)(void),
                      void (*end)(void), void *stack);

int __libc_start_main(int (*main)(int, char **, char **), int argc, char **argv, void (*init)(void), void (*fini)(void),
                      void (*end)(void), void *stack)
{
    real_main = main;
    return ((start_fn)dlsym(RTLD_NEXT, "__libc_start_main"))(watched_main, argc, argv, init, fini, end, stack);
}

static int fails(enum Call call)
{
    if (loading || (int)call != chosen || (is_started || (long)syscall(SYS_getpid) != (long)self) != fail_child)
        return 0;
    const long n = atomic_fetch_add(&seen, 1) + 1;
    if (n != fail_at && !(fail_on && n > fail_at))
        return 0;
    if (n == fail_at && mark) {
        const int fd = (int)syscall(SYS_open, mark, O_WRONLY | O_CREAT | O_APPEND, 0600);
        syscall(SYS_write, fd, "reached\n", (size_t)8);
        syscall(SYS_close, fd);
    }
    errno = errors[call];
    return 1;
}

#define NEXT(type, name) ((type)dlsym(RTLD_NEXT, name))

void *dlopen(const char *path, int flags)
{
    typedef void *(*dlopen_fn)(const char *, int);
    loading = 1;
    void *library = NEXT(dlopen_fn, "dlopen")(path, flags);
    loading = 0;
    return library;
}

extern void *__libc_malloc(size_t n);
extern void *__libc_calloc(size_t n, size_t size);
extern void *__libc_realloc(void *p, size_t n);

void *malloc(size_t n)
{
    return fails(MALLOC) ? NULL : __libc_malloc(n);
}

void *calloc(size_t n, size_t size)
{
    return fails(MALLOC) ? NULL : __libc_calloc(n, size);
}

void *realloc(void *p, size_t n)
{
    return fails(MALLOC) ? NULL : __libc_realloc(p, n);
}

static int open_with(int folder, const char *path, int flags, mode_t mode)
{
    typedef int (*open_fn)(int, const char *, int, ...);
    return fails(OPEN) ? -1 : NEXT(open_fn, "openat")(folder, path, flags, mode);
}

int open(const char *path, int flags, ...)
{
    va_list args;
    va_start(args, flags);
    const mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(args, mode_t) : 0;
    va_end(args);
    return open_with(AT_FDCWD, path, flags, mode);
}

int open64(const char *path, int flags, ...)
{
    va_list args;
    va_start(args, flags);
    const mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(args, mode_t) : 0;
    va_end(args);
    return open_with(AT_FDCWD, path, flags, mode);
}

ssize_t read(int fd, void *bytes, size_t n)
{
    typedef ssize_t (*read_fn)(int, void *, size_t);
    return fails(READ) ? -1 : NEXT(read_fn, "read")(fd, bytes, n);
}

ssize_t pread(int fd, void *bytes, size_t n, off_t at)
{
    typedef ssize_t (*pread_fn)(int, void *, size_t, off_t);
    return fails(READ) ? -1 : NEXT(pread_fn, "pread")(fd, bytes, n, at);
}

ssize_t pread64(int fd, void *bytes, size_t n, off64_t at)
{
    typedef ssize_t (*pread_fn)(int, void *, size_t, off64_t);
    return fails(READ) ? -1 : NEXT(pread_fn, "pread64")(fd, bytes, n, at);
}

ssize_t write(int fd, const void *bytes, size_t n)
{
    typedef ssize_t (*write_fn)(int, const void *, size_t);
    return fd > 2 && fails(WRITE) ? -1 : NEXT(write_fn, "write")(fd, bytes, n);
}

ssize_t pwrite64(int fd, const void *bytes, size_t n, off64_t at)
{
    typedef ssize_t (*pwrite_fn)(int, const void *, size_t, off64_t);
    return fails(WRITE) ? -1 : NEXT(pwrite_fn, "pwrite64")(fd, bytes, n, at);
}

int fsync(int fd)
{
    typedef int (*fsync_fn)(int);
    return fails(FSYNC) ? -1 : NEXT(fsync_fn, "fsync")(fd);
}

int rename(const char *from, const char *to)
{
    typedef int (*rename_fn)(const char *, const char *);
    return fails(RENAME) ? -1 : NEXT(rename_fn, "rename")(from, to);
}

int renameat2(int from_fd, const char *from, int to_fd, const char *to, unsigned flags)
{
    typedef int (*rename_fn)(int, const char *, int, const char *, unsigned);
    return fails(RENAME) ? -1 : NEXT(rename_fn, "renameat2")(from_fd, from, to_fd, to, flags);
}

int posix_spawnp(pid_t *pid, const char *path, const posix_spawn_file_actions_t *files, const posix_spawnattr_t *how,
                 char *const arguments[], char *const environment[])
{
    typedef int (*spawn_fn)(pid_t *, const char *, const posix_spawn_file_actions_t *, const posix_spawnattr_t *,
                            char *const *, char *const *);
    if (fails(SPAWN))
        return errors[SPAWN];
    const int why = NEXT(spawn_fn, "posix_spawnp")(pid, path, files, how, arguments, environment);
    child = why ? child : *pid;
    return why;
}

ssize_t send(int socket, const void *bytes, size_t n, int flags)
{
    typedef ssize_t (*send_fn)(int, const void *, size_t, int);
    const ssize_t sent = NEXT(send_fn, "send")(socket, bytes, n, flags);
    if (fails(KILL))
        kill(child, SIGKILL);
    return sent;
}

int shmget(key_t key, size_t n, int flags)
{
    return fails(SHMGET) ? -1 : (int)syscall(SYS_shmget, key, n, flags);
}

int poll(struct pollfd *fds, nfds_t n, int timeout_ms)
{
    typedef int (*poll_fn)(struct pollfd *, nfds_t, int);
    return fails(POLL) ? -1 : NEXT(poll_fn, "poll")(fds, n, timeout_ms);
}

ssize_t recv(int socket, void *bytes, size_t n, int flags)
{
    typedef ssize_t (*recv_fn)(int, void *, size_t, int);
    return fails(RECV) ? -1 : NEXT(recv_fn, "recv")(socket, bytes, n, flags);
}

int accept4(int socket, struct sockaddr *from, socklen_t *n, int flags)
{
    typedef int (*accept_fn)(int, struct sockaddr *, socklen_t *, int);
    return fails(ACCEPT) ? -1 : NEXT(accept_fn, "accept4")(socket, from, n, flags);
}

int waitid(idtype_t by, id_t id, siginfo_t *how, int options)
{
    typedef int (*wait_fn)(idtype_t, id_t, siginfo_t *, int);
    return fails(WAITID) ? -1 : NEXT(wait_fn, "waitid")(by, id, how, options);
}

ssize_t getrandom(void *bytes, size_t n, unsigned flags)
{
    typedef ssize_t (*random_fn)(void *, size_t, unsigned);
    return fails(GETRANDOM) ? -1 : NEXT(random_fn, "getrandom")(bytes, n, flags);
}
