/* Preloaded into programs that would listen on every address (storescp has no option for it): they listen on the
 * loopback alone. */
#include <dlfcn.h>
#include <netinet/in.h>
#include <string.h>
#include <sys/socket.h>

int bind(int fd, const struct sockaddr *address, socklen_t n);
int bind(int fd, const struct sockaddr *address, socklen_t n)
{
    int (*next)(int, const struct sockaddr *, socklen_t);
    void *found = dlsym(RTLD_NEXT, "bind");
    memcpy(&next, &found, sizeof next);
    struct sockaddr_in copy;
    if (address->sa_family != AF_INET || n < sizeof copy)
        return next(fd, address, n);
    memcpy(&copy, address, sizeof copy);
    if (copy.sin_addr.s_addr == htonl(INADDR_ANY))
        copy.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return next(fd, (const struct sockaddr *)&copy, sizeof copy);
}
