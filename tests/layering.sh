#!/bin/sh
# The one-way flow, read off the #include lines: layering.sh SOURCE_ROOT
#
#     dicom -> volume -> table -> transfer -> scene -> splat, tiled or raycast -> render -> image -> export,
#     with report, job, check, bench and cli on top
#
# A row: folder | headers of the tree it may include (a folder/ means all of it) | library headers.
# Every folder may include its own headers, base/ and the C library.
set -eu

table='
include/ctsplat | ctsplat/ |
src/base     | ctsplat/status.h ctsplat/report.h | openssl/ jansson.h
src/dicom    | ctsplat/status.h ctsplat/report.h ctsplat/series.h ctsplat/volume.h volume/assemble.h | zlib.h openjpeg.h seccomp.h zip.h
src/volume   | ctsplat/status.h ctsplat/report.h ctsplat/volume.h ctsplat/series.h dicom/slice.h dicom/slice_stack.h | immintrin.h
src/table    | ctsplat/status.h ctsplat/report.h ctsplat/table.h ctsplat/volume.h volume/ |
src/transfer | ctsplat/status.h ctsplat/mixture.h ctsplat/preset.h ctsplat/volume.h | jansson.h expat.h
src/scene    | ctsplat/status.h ctsplat/report.h ctsplat/volume.h ctsplat/preset.h ctsplat/picture.h ctsplat/render.h volume/ transfer/lut.h |
src/splat    | ctsplat/status.h ctsplat/report.h ctsplat/volume.h ctsplat/preset.h ctsplat/picture.h ctsplat/render.h volume/ transfer/ scene/ | immintrin.h
src/tiled    | ctsplat/status.h ctsplat/report.h ctsplat/volume.h ctsplat/preset.h ctsplat/picture.h ctsplat/render.h volume/ transfer/ scene/ | immintrin.h
src/raycast  | ctsplat/status.h ctsplat/report.h ctsplat/volume.h ctsplat/preset.h ctsplat/picture.h ctsplat/render.h volume/ scene/ |
src/render   | ctsplat/status.h ctsplat/mixture.h ctsplat/report.h ctsplat/volume.h ctsplat/preset.h ctsplat/picture.h ctsplat/render.h ctsplat/reference.h volume/ transfer/ scene/ raycast/ |
src/image    | ctsplat/status.h ctsplat/annotate.h ctsplat/picture.h ctsplat/preset.h | cairo.h
src/export   | ctsplat/status.h ctsplat/report.h ctsplat/picture.h ctsplat/export.h ctsplat/series.h image/ dicom/dcm_sc.h | png.h openexr.h zlib.h libdeflate.h
src/report   | ctsplat/ | jansson.h cairo.h
src/job      | ctsplat/ report/ |
src/check    | ctsplat/ report/ |
src/bench    | ctsplat/ report/ |
src/contact  | ctsplat/ image/ | jansson.h webp/
src/batch    | ctsplat/ report/ job/ contact/ | jansson.h
src/cli      | ctsplat/ report/ job/ check/ bench/ batch/ contact/ | jansson.h png.h openexr_base.h expat.h
'

# Prints every include that the table does not allow; silent when all is well.
violations()
{
    (cd "$1" && find src include -name '*.h' -o -name '*.c' -o -name '*.cc' -o -name '*.cpp' -o -name '*.hpp' | LC_ALL=C sort |
        xargs grep -nHE '^[[:blank:]]*#[[:blank:]]*include' /dev/null) |
        awk -v table="$table" '
        BEGIN {
            rows = split(table, row, "\n")
            for (r = 1; r <= rows; r++) {
                split(row[r], part, "|")
                folder = part[1]
                gsub(/ /, "", folder)
                own[folder] = part[2]
                library[folder] = part[3]
            }
            # What counts as a library; all else in <> is the C library, POSIX or C++.
            libraries = "^(dcmtk/|png|openexr|ImfC|jansson|expat|cairo|zlib|libdeflate|immintrin|openssl/|openjpeg|seccomp|zip\\.h|webp/)"
        }
        function listed(list, header,    n, i, words) {
            n = split(list, words, " ")
            for (i = 1; i <= n; i++)
                if (header == words[i] || (words[i] ~ /\/$/ && index(header, words[i]) == 1))
                    return 1
            return 0
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
            if (!(folder in own))
                why = "has no row in the table"
            else if (quoted)
                why = index(header, name "/") == 1 || index(header, "base/") == 1 && folder ~ /^src/ || listed(own[folder], header) \
                    ? "" : "may not include it"
            else if (header ~ /^dcmtk\//)
                why = folder == "src/dicom" && file ~ /\.(cc|hpp)$/ ? "" : "DCMTK stays in the C++ files of src/dicom"
            else
                why = header !~ libraries || listed(library[folder], header) ? "" : "may not use that library"
            if (file ~ /\.(cc|cpp|hpp)$/ && folder != "src/dicom")
                why = "C++ stays in src/dicom"
            if (header ~ /^dicom\// && folder == "src/volume" && file !~ /\/assemble\.[ch]$/)
                why = "only assemble.c may know slices"
            if (why != "")
                print $0 ": " why
        }'
}

# breach FOLDER/FILE INCLUDE: the check must see this one
breach()
{
    mkdir -p "$work/include" "$work/src" "$work/${1%/*}"
    printf '#include %s\n' "$2" >"$work/$1"
    [ -n "$(violations "$work")" ] || {
        echo "layering.sh is blind: $1 may include $2"
        exit 1
    }
    rm -r "$work/src" "$work/include"
}

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
breach src/base/a.c '"scene/view.h"'
breach src/splat/a.c '"dicom/slice.h"'
breach src/raycast/a.c '"splat/sheet.h"'
breach src/raycast/a.c '"transfer/lut.h"'
breach src/cli/a.c '"scene/engine.h"'
breach src/tiled/a.c '"splat/sheet.h"'
breach src/splat/a.c '"tiled/slab.h"'
breach src/volume/crop.c '"dicom/slice.h"'
breach src/export/a.c '<dcmtk/dcmdata/dctk.h>'
breach src/dicom/a.c '<dcmtk/dcmdata/dctk.h>'
breach src/splat/a.c '<png.h>'
breach src/splat/a.cc '<cmath>'
breach src/other/a.c '<math.h>'
breach include/ctsplat/a.h '"base/mem.h"'

found=$(violations "$1")
[ -z "$found" ] || {
    printf '%s\n' "$found"
    exit 1
}
