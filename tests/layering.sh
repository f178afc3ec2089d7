#!/bin/sh
# The one-way flow, read off the #include lines: layering.sh SOURCE_ROOT
#
# A row: room | rooms or headers of the tree that it may include | library headers.
# Every room may include its own headers, base/, the public headers of PUBLIC that stand at its wing or before it, and
# what `everywhere` lists: the C library, POSIX and, in C++, the C++ library. A header that stands in neither is
# refused, known or not. The rows stand in the order of the flow: a room may only name rooms above its own, so there
# are no circles. `!header` is such a circle that is still there; it is refused as soon as nothing includes it.
set -eu

table='
include/ctsplat | ctsplat/ |
src/base          | | immintrin.h openssl/ jansson.h dlfcn.h link.h seccomp.h malloc.h zlib.h
src/core/volume   | | emmintrin.h
src/core/model    | core/volume/ |
src/core/labels   | core/volume/ core/model/ |
src/core/couch    | core/volume/ core/model/ |
src/core/transfer | | expat.h
src/core/scene    | core/model/ core/transfer/lut.h |
src/dicom/dcmtk   | | dicom_tags.inc
src/dicom/protocol | |
src/dicom/header  | core/volume/stored.h dicom/protocol/ | iconv.h
src/dicom/codec   | dicom/protocol/ dicom/header/ |
src/dicom/pixels  | dicom/dcmtk/ dicom/protocol/ | openjpeg.h zip.h zlib.h
src/dicom/writer  | dicom/dcmtk/ dicom/header/ |
src/dicom/reader  | dicom/dcmtk/ dicom/protocol/ dicom/header/ dicom/writer/ |
src/dicom/objects | dicom/protocol/ dicom/header/ dicom/codec/ | dicom_names.inc srgb.inc
src/dicom/net     | dicom/dcmtk/ dicom/header/ | curl/ jansson.h netdb.h netinet/ openssl/
src/input/files   | core/volume/box.h dicom/protocol/ dicom/header/ | jansson.h
src/input/series  | dicom/header/ dicom/codec/ input/files/ |
src/input/load    | core/volume/ dicom/header/slice.h dicom/codec/ input/files/ input/series/ |
src/input/labels  | core/labels/ dicom/protocol/ dicom/header/ dicom/codec/ input/files/ | expat.h
src/engine/project | core/model/ core/scene/ |
src/engine/tiled  | core/model/ core/scene/ engine/project/project.h |
src/engine/sheets | core/model/ core/scene/ |
src/engine/splat  | core/model/ core/transfer/ core/scene/ |
src/engine/raycast | core/model/ core/scene/ |
src/render/engines | core/scene/ |
src/render/framing | core/scene/ render/engines/ |
src/render/error  | core/scene/ engine/raycast/ render/engines/ render/framing/ |
src/render/frames | core/model/ core/scene/ render/engines/ render/framing/ render/error/ |
src/output/image  | |
src/output/export | dicom/objects/ output/image/ | png.h openexr.h zlib.h jpeglib.h webp/
src/output/report | | jansson.h
src/lab/check     | core/scene/engine.h |
src/lab/bench     | output/report/ |
src/app/job       | render/framing/framing.h output/image/ |
src/app/options   | output/image/whole_picture.h app/job/ |
src/app/contact   | output/image/ output/report/info.h app/job/patient_sections.h | jansson.h webp/
src/app/batch     | dicom/codec/pixels.h output/export/sc_texts.h output/report/ app/job/ app/options/ app/contact/ | jansson.h
src/app/serve     | dicom/codec/pixels.h dicom/header/slice.h dicom/net/listener.h output/report/redact.h app/job/ app/options/ | microhttpd.h jansson.h arpa/inet.h netinet/in.h sys/un.h
src/cli           | output/report/ lab/check/ lab/bench/ app/ | jansson.h png.h openexr_base.h expat.h
'
# The public headers by the wing whose words they are, and the wings whose headers a wing may use.
public='
base | api status bounds diagnostic report | base
core | mixture preset quantity volume model labels table picture render | base core
dicom | series net | base core dicom
input | label_files | base core dicom input
engine | | base core
render | reference | base core render
output | annotate export state | base core dicom input output
lab | | base core dicom input render output
app | ctsplat job | base core dicom input render output app
cli | | base core dicom input render output app
include | | base core dicom input render output app
'

everywhere=' assert ctype dirent endian errno fcntl float fnmatch fts ftw glob inttypes libgen limits locale math
 poll pthread sched semaphore setjmp signal spawn stdalign stdarg stdatomic stdbool stddef stdint stdio stdlib string
 strings sys/auxv sys/file sys/mman sys/pidfd sys/prctl sys/random sys/resource sys/shm sys/socket sys/stat sys/statvfs sys/syscall sys/sysinfo sys/time sys/types
 sys/wait time unistd wchar '
cxx=' algorithm array atomic cctype charconv cerrno climits cmath condition_variable cstdarg cstddef cstdint cstdio cstdlib cstring ctime exception
 functional limits map memory mutex new optional set shared_mutex stdexcept string string_view thread utility vector '

# Prints every include that the tables do not allow; silent when all is well.
violations()
{
    (cd "$1" && find src include -name '*.h' -o -name '*.c' -o -name '*.cc' -o -name '*.cpp' -o -name '*.hpp' | LC_ALL=C sort |
        xargs grep -nHE '^[[:blank:]]*#[[:blank:]]*include' /dev/null) |
        awk -v table="$table" -v public="$public" -v everywhere="$everywhere" -v cxx="$cxx" -v part_of_a_trial="${2-}" '
        BEGIN {
            n = split(public, row, "\n")
            for (r = 1; r <= n; r++) {
                split(row[r], part, "|")
                gsub(/ /, "", part[1])
                m = split(part[2], words, " ")
                for (i = 1; i <= m; i++)
                    wing_of["ctsplat/" words[i] ".h"] = part[1]
                seen_by[part[1]] = part[3]
            }
            rows = split(table, row, "\n")
            for (r = 1; r <= rows; r++) {
                split(row[r], part, "|")
                folder = part[1]
                gsub(/ /, "", folder)
                if (folder == "")
                    continue
                own[folder] = part[2]
                library[folder] = part[3]
                n = split(part[2], words, " ")
                for (i = 1; i <= n; i++)
                    if (words[i] !~ /^!/ && words[i] != "ctsplat/" && words[i] != "app/" && !(room_of(words[i]) in own))
                        print folder ": " words[i] " stands below its row, or nowhere"
            }
        }
        function room_of(header) {
            sub(/\/[^\/]*$/, "", header)
            return "src/" header
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
        function is_public(header, folder,    wing) {
            wing = folder
            sub(/^src\//, "", wing)
            sub(/\/.*/, "", wing)
            return header in wing_of && listed(seen_by[wing], wing_of[header])
        }
        {
            file = $0
            sub(/:.*/, "", file)
            folder = file
            sub(/\/[^\/]*$/, "", folder)
            match($0, /["<][^">]*[">]/)
            header = substr($0, RSTART + 1, RLENGTH - 2)
            quoted = substr($0, RSTART, 1) == "\""
            seen[folder] = 1
            used[folder] = used[folder] " " (quoted ? "!" : "") header
            if (!(folder in own))
                why = "has no row in the table"
            else if (quoted)
                why = room_of(header) == folder || index(header, "base/") == 1 && folder ~ /^src/ || is_public(header, folder) || \
                    listed(own[folder], header) || listed(own[folder], "!" header) ? "" : "may not include it"
            else if (header ~ /^dcmtk\//)
                why = folder ~ dcmtk && file ~ /\/dcmtk_[a-z_]*\.(cc|hpp)$/ ? "" : "DCMTK is called by dcmtk_*.cc of its rooms"
            else
                why = is_standard(header, file) || listed(library[folder], header) ? "" : "may not use that library"
            if (file ~ /\.(cc|cpp|hpp)$/ && folder !~ dcmtk)
                why = "C++ stays in the rooms of DCMTK"
            if (why != "")
                print $0 ": " why
            if (file ~ /\/dcmtk_[^\/]*$/)
                calls[file] += header ~ /(^dcmtk\/|\/dcmtk_)/
        }
        # Rows for what is not there would let it in unseen.
        END {
            for (file in calls)
                if (!calls[file])
                    print file ": calls no DCMTK, but is named so"
            for (folder in own) {
                if (!(folder in seen) && !part_of_a_trial)
                    print folder ": has a row but no file"
                n = split(library[folder] " " own[folder], allowed, " ")
                for (i = 1; i <= n && folder in seen && !part_of_a_trial; i++)
                    if (allowed[i] ~ /^!/ ? !listed(used[folder], allowed[i]) : \
                        !index(used[folder], " " allowed[i]) && !index(used[folder], " !" allowed[i]))
                        print folder ": " allowed[i] " stands in its row, but nothing includes it"
            }
        }' dcmtk='^src/dicom/'
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
breach src/engine/splat/a.c '"dicom/header/slice.h"'
breach src/engine/splat/a.c '"ctsplat/series.h"'
breach src/core/volume/a.c '"ctsplat/export.h"'
breach src/core/volume/a.c '"core/couch/body.h"'
breach src/core/volume/a.c '"core/model/macrocells.h"'
breach src/engine/raycast/a.c '"engine/splat/sheet.h"'
breach src/engine/raycast/a.c '"core/transfer/lut.h"'
breach src/cli/a.c '"core/scene/engine.h"'
breach src/engine/tiled/a.c '"engine/splat/sheet.h"'
breach src/engine/splat/a.c '"engine/tiled/tiled_march.h"'
breach src/input/files/a.c '"input/series/slice_stack.h"'
breach src/dicom/protocol/a.c '"dicom/header/slice.h"'
breach src/dicom/net/a.c '"input/files/scan.h"'
breach src/dicom/header/a.c '"input/load/load.h"'
breach src/render/error/a.c '"render/frames/frames.h"'
breach src/output/export/a.c '"app/job/render_job.h"'
breach src/output/export/a.c '<dcmtk/dcmdata/dctk.h>'
breach src/dicom/header/a.c '<dcmtk/dcmdata/dctk.h>'
breach src/input/files/dcmtk_a.cc '<dcmtk/dcmdata/dctk.h>'
breach src/dicom/reader/a.cc '<dcmtk/dcmdata/dctk.h>'
breach src/dicom/reader/dcmtk_a.cc '<cmath>'
breach src/engine/splat/a.c '<png.h>'
breach src/base/a.c '<no-such-library.h>'
breach src/dicom/header/a.c '<vector>'
breach src/engine/splat/a.cc '<cmath>'
breach src/other/a.c '<math.h>'
breach include/ctsplat/a.h '"base/mem.h"'

found=$(violations "$1")
[ -z "$found" ] || {
    printf '%s\n' "$found"
    exit 1
}
