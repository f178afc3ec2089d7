"""Generates the C source of ctsplat._ctsplat from the public headers: make_binding.py OUTPUT HEADER...

cffi needs declarations without comments, preprocessor lines, attributes and inline functions; nothing is declared
twice."""
import re
import sys

import cffi


def declarations(headers):
    text = ""
    for header in headers:
        with open(header, encoding="utf-8") as file:
            text += file.read()
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.S)
    text = re.sub(r"^\s*#(.*\\\n)*.*$|^CTS_API_(BEGIN|END)$", "", text, flags=re.M)
    # enumerators from a macro list: the compiler counts them
    text = re.sub(r"[A-Z_]+\([A-Z_]+\) (CTS_N_[A-Z]+)", r"\1, ...", text)
    text = re.sub(r"__attribute__\s*\(\(.*?\)\)(?=;)", "", text, flags=re.S)
    return re.sub(r"static inline [^{]*\{.*?\n\}", "", text, flags=re.S)


# Python handles signals between its own steps alone; a picture must end before that.
INTERRUPTS = """
#include <ctsplat/ctsplat.h>
#include <stdlib.h>

static volatile sig_atomic_t interrupted;
static struct sigaction before;

static void on_interrupt(int number)
{
    interrupted = 1;
    before.sa_handler(number);
}

static volatile sig_atomic_t *interrupts_stop(void)
{
    const struct sigaction own = {.sa_handler = on_interrupt, .sa_flags = SA_ONSTACK};
    interrupted = 0;
    sigaction(SIGINT, NULL, &before);
    if (before.sa_handler != SIG_DFL && before.sa_handler != SIG_IGN && !(before.sa_flags & SA_SIGINFO))
        sigaction(SIGINT, &own, NULL);
    return &interrupted;
}

static void interrupts_pass(void)
{
    sigaction(SIGINT, &before, NULL);
}
"""


def main(output, *headers):
    ffi = cffi.FFI()
    ffi.cdef("typedef int sig_atomic_t;\n" + declarations(headers) + """
void free(void *);
volatile sig_atomic_t *interrupts_stop(void);
void interrupts_pass(void);
extern "Python" CtsStatus take_frame(void *context, int frame, CtsPicture *picture, CtsError *err);
""")
    ffi.set_source("ctsplat._ctsplat", INTERRUPTS)
    ffi.emit_c_code(output)


main(*sys.argv[1:])
