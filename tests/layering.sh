#!/bin/sh
# The one-way flow, read off the #include lines: layering.sh SOURCE_ROOT
#
#     dicom -> volume -> table -> transfer -> scene -> splat, tiled or raycast -> render -> image -> export,
#     with report, job, check, bench and cli on top
#
# A row: folder | headers of the tree it may include (a folder/ means all of it) | library headers.
# Every folder may include its own headers, base/, and what `everywhere` lists: the C library, POSIX and, in C++,
# the C++ library. A header that stands in neither is refused, known or not.
set -eu

table='
include/ctsplat | ctsplat/ |
src/base     | ctsplat/status.h ctsplat/bounds.h ctsplat/report.h | openssl/ jansson.h dlfcn.h link.h
src/dicom    | ctsplat/status.h ctsplat/bounds.h ctsplat/report.h ctsplat/series.h ctsplat/volume.h volume/assemble.h | zlib.h openjpeg.h openjph/ seccomp.h malloc.h zip.h
src/volume   | ctsplat/status.h ctsplat/report.h ctsplat/volume.h ctsplat/series.h input/header/slice.h input/series/slice_stack.h core/volume/stored.h | immintrin.h emmintrin.h
src/table    | ctsplat/status.h ctsplat/report.h ctsplat/table.h ctsplat/volume.h volume/ |
src/transfer | ctsplat/status.h ctsplat/mixture.h ctsplat/preset.h ctsplat/volume.h | expat.h
src/scene    | ctsplat/status.h ctsplat/bounds.h ctsplat/report.h ctsplat/volume.h ctsplat/preset.h ctsplat/picture.h ctsplat/render.h volume/ core/transfer/lut.h |
src/splat    | ctsplat/status.h ctsplat/bounds.h ctsplat/report.h ctsplat/volume.h ctsplat/preset.h ctsplat/picture.h ctsplat/render.h volume/ transfer/ scene/ | immintrin.h
src/tiled    | ctsplat/status.h ctsplat/report.h ctsplat/volume.h ctsplat/preset.h ctsplat/picture.h ctsplat/render.h volume/ transfer/ scene/ | immintrin.h
src/raycast  | ctsplat/status.h ctsplat/bounds.h ctsplat/report.h ctsplat/volume.h ctsplat/preset.h ctsplat/picture.h ctsplat/render.h volume/ scene/ |
src/render   | ctsplat/status.h ctsplat/mixture.h ctsplat/report.h ctsplat/volume.h ctsplat/preset.h ctsplat/picture.h ctsplat/render.h ctsplat/reference.h volume/ transfer/ scene/ raycast/ |
src/image    | ctsplat/status.h ctsplat/bounds.h ctsplat/annotate.h ctsplat/picture.h ctsplat/preset.h |
src/export   | ctsplat/status.h ctsplat/bounds.h ctsplat/report.h ctsplat/picture.h ctsplat/export.h ctsplat/series.h ctsplat/state.h ctsplat/preset.h image/ output/objects/dcm_sc.h output/objects/dcm_state.h | png.h openexr.h zlib.h
src/net      | ctsplat/status.h ctsplat/report.h ctsplat/net.h input/header/dcm_ids.h input/header/dcm_read.h | curl/ jansson.h
src/report   | ctsplat/ | jansson.h png.h
src/job      | ctsplat/ report/ |
src/check    | ctsplat/ report/ |
src/bench    | ctsplat/ report/ |
src/contact  | ctsplat/ image/ | jansson.h webp/
src/batch    | ctsplat/ report/ job/ contact/ | jansson.h
src/cli      | ctsplat/ report/ job/ check/ bench/ batch/ contact/ | jansson.h png.h openexr_base.h expat.h
'

everywhere=' assert ctype dirent endian errno fcntl float fnmatch ftw inttypes libgen limits locale math
 poll pthread sched semaphore setjmp signal spawn stdalign stdarg stdatomic stdbool stddef stdint stdio stdlib string
 strings sys/file sys/mman sys/prctl sys/random sys/resource sys/socket sys/stat sys/statvfs sys/syscall sys/time sys/types
 sys/wait time unistd wchar '
cxx=' algorithm array atomic cctype charconv cerrno climits cmath cstdarg cstddef cstdint cstdio cstdlib cstring exception functional
 limits map memory mutex new optional set shared_mutex stdexcept string string_view thread utility vector '

# Prints every include that the table does not allow; silent when all is well.
violations()
{
    (cd "$1" && find src include -name '*.h' -o -name '*.c' -o -name '*.cc' -o -name '*.cpp' -o -name '*.hpp' | LC_ALL=C sort |
        xargs grep -nHE '^[[:blank:]]*#[[:blank:]]*include' /dev/null) |
        awk -v table="$table" -v everywhere="$everywhere" -v cxx="$cxx" -v part_of_a_trial="${2-}" '
        BEGIN {
            rows = split(table, row, "\n")
            for (r = 1; r <= rows; r++) {
                split(row[r], part, "|")
                folder = part[1]
                gsub(/ /, "", folder)
                own[folder] = part[2]
                library[folder] = part[3]
            }
        }
        function listed(list, header,    n, i, words) {
            n = split(list, words, " ")
            for (i = 1; i <= n; i++)
                if (header == words[i] || (words[i] ~ /\/$/ && index(header, words[i]) == 1))
                    return 1
            return 0
        }
        function is_standard(header, file) {
            if (header ~ /\.h$/)
                return listed(everywhere, substr(header, 1, length(header) - 2))
            return file ~ /\.(cc|hpp)$/ && listed(cxx, header)
        }
        {
            file = $0
            sub(/:.*/, "", file)
            folder = file
            sub(/\/[^\/]*$/, "", folder)
            match($0, /["<][^">]*[">]/)
            header = substr($0, RSTART + 1, RLENGTH - 2)
            quoted = substr($0, RSTART, 1) == "\""
            name = folder
            sub(/.*\//, "", name)
            seen[folder] = 1
            if (!quoted)
                used[folder] = used[folder] " " header
            if (!(folder in own))
                why = "has no row in the table"
            else if (quoted)
                why = index(header, name "/") == 1 || index(header, "base/") == 1 && folder ~ /^src/ || listed(own[folder], header) \
                    ? "" : "may not include it"
            else if (header ~ /^dcmtk\//)
                why = folder ~ /^src\/(dicom|net)$/ && file ~ /\.(cc|hpp)$/ ? "" : "DCMTK stays in the C++ of src/dicom and src/net"
            else
                why = is_standard(header, file) || listed(library[folder], header) ? "" : "may not use that library"
            if (file ~ /\.(cc|cpp|hpp)$/ && folder !~ /^src\/(dicom|net)$/)
                why = "C++ stays in src/dicom and src/net"
            if (header ~ /^dicom\/slice/ && folder == "src/volume" && file !~ /\/assemble\.[ch]$/)
                why = "only assemble.c may know slices"
            if (why != "")
                print $0 ": " why
        }
        # Rows for what is not there would let it in unseen.
        END {
            for (folder in own) {
                if (folder != "" && !(folder in seen) && !part_of_a_trial)
                    print folder ": has a row but no file"
                n = split(library[folder], allowed, " ")
                for (i = 1; i <= n && folder in seen && !part_of_a_trial; i++)
                    if (!index(used[folder], " " allowed[i]))
                        print folder ": " allowed[i] " stands in its row, but nothing includes it"
            }
        }'
}

# breach FOLDER/FILE INCLUDE: the check must see this one
breach()
{
    mkdir -p "$work/include" "$work/src" "$work/${1%/*}"
    printf '#include %s\n' "$2" >"$work/$1"
    [ -n "$(violations "$work" 1)" ] || {
        echo "layering.sh is blind: $1 may include $2"
        exit 1
    }
    rm -r "$work/src" "$work/include"
}

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
breach src/base/a.c '"core/scene/view.h"'
breach src/splat/a.c '"input/header/slice.h"'
breach src/raycast/a.c '"engine/splat/sheet.h"'
breach src/raycast/a.c '"core/transfer/lut.h"'
breach src/cli/a.c '"core/scene/engine.h"'
breach src/tiled/a.c '"engine/splat/sheet.h"'
breach src/splat/a.c '"engine/tiled/slab.h"'
breach src/core/volume/crop.c '"input/header/slice.h"'
breach src/export/a.c '<dcmtk/dcmdata/dctk.h>'
breach src/dicom/a.c '<dcmtk/dcmdata/dctk.h>'
breach src/splat/a.c '<png.h>'
breach src/base/a.c '<no-such-library.h>'
breach src/dicom/a.c '<vector>'
breach src/splat/a.cc '<cmath>'
breach src/other/a.c '<math.h>'
breach include/ctsplat/a.h '"base/mem.h"'

found=$(violations "$1")
[ -z "$found" ] || {
    printf '%s\n' "$found"
    exit 1
}
