"""The C source of ctsplat._ctsplat, made from the public headers: make_binding.py OUTPUT HEADER_FOLDER

cffi wants declarations without comments, preprocessor lines, attributes and inline functions; nothing is declared twice.
"""
import os
import re
import sys

import cffi

HEADERS = "status report preset picture volume series state export job".split()


def declarations(folder):
    text = ""
    for name in HEADERS:
        with open(os.path.join(folder, name + ".h"), encoding="utf-8") as file:
            text += file.read()
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.S)
    text = re.sub(r"#ifdef __cplusplus\n.*?#endif", "", text, flags=re.S)
    text = re.sub(r"^\s*#.*$", "", text, flags=re.M)
    text = re.sub(r"__attribute__\s*\(\(.*?\)\)(?=;)", "", text, flags=re.S)
    return re.sub(r"static inline [^{]*\{.*?\n\}", "", text, flags=re.S)


def main(output, folder):
    ffi = cffi.FFI()
    ffi.cdef("typedef int sig_atomic_t;\n" + declarations(folder) + """
void free(void *);
extern "Python" CtsStatus take_frame(void *context, int frame, CtsPicture *picture, CtsError *err);
""")
    ffi.set_source("ctsplat._ctsplat", "#include <ctsplat/ctsplat.h>\n#include <stdlib.h>")
    ffi.emit_c_code(output)


main(*sys.argv[1:])
