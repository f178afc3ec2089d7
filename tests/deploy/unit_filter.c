/* Runs a program as systemd's SystemCallFilter=, SystemCallErrorNumber=EPERM, RestrictAddressFamilies= and
 * MemoryDenyWriteExecute= would: unit_filter NAMES PROGRAM ARGUMENT...; NAMES is a file of system calls, one a line. */
#include <errno.h>
#include <seccomp.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/shm.h>
#include <sys/socket.h>
#include <unistd.h>

static int allow(scmp_filter_ctx filter, const char *name)
{
    static const int families[] = {AF_UNIX, AF_INET, AF_INET6};
    const int call = seccomp_syscall_resolve_name(name);
    int result = 0;
    if (call == __NR_SCMP_ERROR)
        return 0; /* of another kernel */
    if (call == SCMP_SYS(socket)) {
        for (int i = 0; i < 3 && !result; i++)
            result =
                seccomp_rule_add(filter, SCMP_ACT_ALLOW, call, 1, SCMP_A0(SCMP_CMP_EQ, (scmp_datum_t)families[i], 0));
        return result;
    }
    if (call == SCMP_SYS(mprotect) || call == SCMP_SYS(pkey_mprotect))
        return seccomp_rule_add(filter, SCMP_ACT_ALLOW, call, 1, SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0));
    if (call == SCMP_SYS(shmat))
        return seccomp_rule_add(filter, SCMP_ACT_ALLOW, call, 1, SCMP_A2(SCMP_CMP_MASKED_EQ, SHM_EXEC, 0));
    if (call == SCMP_SYS(mmap)) { /* never both */
        result = seccomp_rule_add(filter, SCMP_ACT_ALLOW, call, 1, SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0));
        return result ? result
                      : seccomp_rule_add(filter, SCMP_ACT_ALLOW, call, 1,
                                         SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC | PROT_WRITE, PROT_EXEC));
    }
    result = seccomp_rule_add(filter, SCMP_ACT_ALLOW, call, 0);
    return result == -EEXIST ? 0 : result;
}

int main(int argc, char **argv)
{
    char name[80];
    FILE *names = argc > 2 ? fopen(argv[1], "re") : NULL;
    scmp_filter_ctx filter = seccomp_init(SCMP_ACT_ERRNO(EPERM));
    int result = names && filter ? 0 : -EINVAL;
    while (!result && fscanf(names, "%79s", name) == 1)
        if ((result = allow(filter, name)))
            fprintf(stderr, "%s: %s\n", name, strerror(-result));
    if (!result)
        result = seccomp_load(filter);
    if (result) {
        fprintf(stderr, "no filter: %s\n", strerror(-result));
        return 1;
    }
    execvp(argv[2], argv + 2);
    perror(argv[2]);
    return 1;
}
