#!/bin/sh
# The package's tests: python_runner.sh PYTHON TEST SANITIZED. With a missing dependency, the test is skipped with a
# message.
[ -n "$1" ] || { echo "skip: no python3 with cffi, numpy and headers"; exit 77; }
[ "$3" = false ] || { echo "skip: a library with sanitizers cannot be loaded into Python"; exit 77; }
"$1" -c 'import pytest' 2>/dev/null || { echo "skip: no pytest"; exit 77; }
exec "$1" "$2"
