/* Programs that the program and the library start: those of libexec, which users do not call, and others. */
#pragma once

#include "ctsplat/status.h"
#include <limits.h>
#include <sys/types.h>

/* Path of the program: in the folder that the environment variable CTSPLAT_LIBEXEC names, else in the build folder or
 * the installed folders, relative to the object that contains this code. CTS_ERR_INTERNAL when it is missing. */
CtsStatus cts_libexec_find(const char *program, char path[PATH_MAX], CtsError *err);

/* Starts the program that the first argument names, in PATH where it has no slash; NULL ends them. It inherits the n
 * descriptors, under the numbers in `as`, and no other one of this library's, and all signals are blocked until it
 * unblocks them. A child process of this one: the caller reaps it. */
CtsStatus cts_program_start(const char *const *arguments, const int *descriptors, const int *as, int n, pid_t *pid,
                            CtsError *err);
/* This process becomes a program of libexec, as git runs its commands: signals, files and the exit code are its own
 * then. Returns on failure alone. */
CtsStatus cts_libexec_become(const char *program, const char *const *arguments, CtsError *err);

/* The same as cts_program_start() for a program of libexec with one argument. */
CtsStatus cts_libexec_start(const char *program, const char *argument, const int *descriptors, int n, pid_t *pid,
                            CtsError *err);
