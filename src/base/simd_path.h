/* Files that are compiled once for each SIMD path, with -DCTS_PATH=avx2 and the like (src/meson.build), and in plain C
 * without it. Names that they export end in the path's name. */
#pragma once

#ifndef CTS_PATH
#define CTS_PATH plain
#define CTS_PATH_PLAIN
#endif
#define CTS_JOIN_PATH(name, path) name##_##path
#define CTS_JOIN_THIS_PATH(name, path) CTS_JOIN_PATH(name, path)
#define CTS_ON_PATH(name) CTS_JOIN_THIS_PATH(name, CTS_PATH)
/* Declares them on each path: declare(path). CTS_CPU_CHOICE() chooses one (base/cpu.h). */
#define CTS_EACH_PATH(declare) declare(plain) declare(avx2) declare(avx512)
