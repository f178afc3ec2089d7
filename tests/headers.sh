#!/bin/sh
# Each header compiles alone: headers.sh SOURCE_ROOT CC CXX GENERATED
# Public ones as C and as C++; the tree's own as C, except templates (*_tmpl.h) and headers for C++ only.
set -u

root=$1 cc=$2 cxx=$3 generated=${4%/*}
bad=0

# alone LANGUAGE HEADER COMPILER...
alone()
{
    language=$1 header=$2
    shift 2
    echo "#include \"$header\"" |
        "$@" -Wall -Wextra -Wundef -Werror -fsyntax-only -I"$root/include" -I"$root/src" -I"$generated" -x "$language" - || {
        echo "$header does not compile alone as $language"
        bad=1
    }
}

for path in "$root"/include/ctsplat/*.h; do
    alone c "ctsplat/${path##*/}" "$cc" -std=gnu17
    alone c++ "ctsplat/${path##*/}" "$cxx" -std=c++17
done
for path in $(cd "$root/src" && find . -name '*.h' ! -name '*_tmpl.h' | LC_ALL=C sort); do
    if grep -qE '#include <(dcmtk/|c[a-z]+>|string>|vector>|mutex>)' "$root/src/$path"; then
        alone c++ "${path#./}" "$cxx" -std=c++17
    else
        alone c "${path#./}" "$cc" -std=gnu17
    fi
done
exit $bad
