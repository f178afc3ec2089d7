#include "cli/terminal.h"

#include <string.h>
#include <unistd.h>

volatile sig_atomic_t cli_stop;
static volatile sig_atomic_t may_exit = 1;

static int words_fd;
static size_t words_size;
static const char *volatile words; /* set last, cleared first */
static const char *volatile empty_folder;

static const char message[] = "ctsplat: error: interrupted\n";

static void on_signal(int number)
{
    (void)number;
    if (may_exit) {
        ssize_t written = write(STDERR_FILENO, message, sizeof message - 1);
        if (words)
            written = write(words_fd, words, words_size);
        (void)written;
        if (empty_folder)
            rmdir(empty_folder);
        _exit(130);
    }
    cli_stop = 1;
}

void cli_interrupt_init(void)
{
    struct sigaction action;
    memset(&action, 0, sizeof action);
    action.sa_handler = on_signal;
    sigemptyset(&action.sa_mask);
    const int numbers[] = {SIGINT, SIGTERM, SIGHUP};
    for (int i = 0; i < 3; i++) {
        /* Keep a signal ignored if the parent process ignores it, as nohup does. */
        struct sigaction before;
        if (!sigaction(numbers[i], NULL, &before) && before.sa_handler != SIG_IGN)
            sigaction(numbers[i], &action, NULL);
    }
    /* A closed pipe and a file size limit appear as failed writes; their signals would leave temporary files. */
    signal(SIGPIPE, SIG_IGN);
    signal(SIGXFSZ, SIG_IGN);
}

void cli_interrupt_writes(int fd, const char *text, size_t size)
{
    words = NULL;
    words_fd = fd;
    words_size = size;
    words = text;
}

void cli_interrupt_removes(const char *folder)
{
    empty_folder = folder;
}

void cli_interrupt_sets_stop(void)
{
    may_exit = 0;
}
