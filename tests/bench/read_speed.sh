#!/bin/sh
# Time to find and load a series of 300 uncompressed slices of 512 x 512, against reading its bytes and against other
# readers; and from the folder to a PNG with all stages in: read_speed.sh VOLUME_DUMP PHANTOM RAW2CT [ROUNDS [CTSPLAT]]
#
# Rounds are interleaved and the page cache is warm; prints medians and ratios. Peers that are not installed are left
# out by name. Needs 600 MB in the temporary folder. Never part of a timed test.
set -eu

dump=$1 phantom=$2 raw2ct=$3 rounds=${4:-7} ctsplat=${5:-}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$(dirname "$0")/head_series.sh" "$phantom" "$raw2ct" "$work/series" 300
cat "$work"/series/* >/dev/null

now() { date +%s%N; }

# timed NAME COMMAND...: one run, as "NAME MS"
timed()
{
    name=$1
    shift
    start=$(now)
    "$@" >"$work/out" 2>&1 || {
        echo "read_speed: $name failed:" >&2
        cat "$work/out" >&2
        exit 1
    }
    end=$(now)
    echo "$name $(((end - start) / 1000)) us" >>"$work/times"
}

read_all() { cat "$work"/series/*; }
all_to_null() { read_all >/dev/null; }

vtk='import sys
from vtkmodules.vtkIOImage import vtkDICOMImageReader
r = vtkDICOMImageReader()
r.SetDirectoryName(sys.argv[1])
r.Update()'
has_vtk=no
/usr/bin/python3 -c 'from vtkmodules.vtkIOImage import vtkDICOMImageReader' 2>/dev/null && has_vtk=yes
has_dcm2niix=no
command -v dcm2niix >/dev/null && has_dcm2niix=yes

# A virtual machine pays for each page of memory that no program has touched before; pay that first.
warm=0
while [ $warm -lt 4 ]; do
    "$dump" "$work/series" --copy >/dev/null
    warm=$((warm + 1))
done

round=0
while [ "$round" -lt "$rounds" ]; do
    timed cat all_to_null
    timed ctsplat "$dump" "$work/series"
    timed ctsplat-1-thread "$dump" "$work/series" --threads 1
    if [ -n "$ctsplat" ]; then
        timed ctsplat-render "$ctsplat" render "$work/series" -o "$work/bone.png" --force --log "$work/log"
        timed ctsplat-render-table "$ctsplat" render "$work/series" --remove-table off -o "$work/bone.png" --force
    fi
    "$dump" "$work/series" --copy | awk '/^copy/ { printf "copy %d us\n", $2 * 1000 }' >>"$work/times"
    if [ $has_vtk = yes ]; then
        timed python-vtk-start /usr/bin/python3 -c 'from vtkmodules.vtkIOImage import vtkDICOMImageReader'
        timed vtkDICOMImageReader /usr/bin/python3 -c "$vtk" "$work/series"
    fi
    if [ $has_dcm2niix = yes ]; then
        rm -rf "$work/nii" && mkdir "$work/nii"
        timed dcm2niix dcm2niix -z n -b n -f o -o "$work/nii" "$work/series"
    fi
    round=$((round + 1))
done

# Wall time of each stage, the medians of all rounds.
if [ -n "$ctsplat" ]; then
    sed -n 's/.*"stage":"\([a-z]*\)","wall_ms":\([0-9.]*\),"cpu_ms":\([0-9.]*\).*/\1 \2 \3/p' "$work/log" |
        sort -k1,1 -k2,2n | awk '
        { wall[$1, n[$1]] = $2; cpu[$1, n[$1]++] = $3 }
        END {
            for (stage in n)
                printf "stage %-16s %8.1f ms wall, %.1f ms of processor\n", stage, wall[stage, int(n[stage] / 2)],
                    cpu[stage, int(n[stage] / 2)]
        }' | sort
fi
[ $has_vtk = yes ] || echo "left out, not installed: vtkDICOMImageReader (python3-vtk9)"
[ $has_dcm2niix = yes ] || echo "left out, not installed: dcm2niix"
sort -k1,1 -k2,2n "$work/times" | awk '
    { t[$1, n[$1]++] = $2 }
    function median(name) { return t[name, int(n[name] / 2)] / 1000 }
    END {
        bytes = median("cat") + median("copy")
        for (name in n)
            printf "%-22s %8.1f ms  (%d runs, %.1f to %.1f)\n", name, median(name), n[name], t[name, 0] / 1000, t[name, n[name] - 1] / 1000
        printf "ratio to reading and copying the bytes (at most 2): %.2f\n", median("ctsplat") / bytes
        if ("ctsplat-render" in n)
            printf "a PNG from the folder, all stages, to reading the bytes (aim 2): %.1f; table kept: %.1f\n",
                median("ctsplat-render") / median("cat"), median("ctsplat-render-table") / median("cat")
        if ("vtkDICOMImageReader" in n)
            printf "faster than vtkDICOMImageReader, less its start (at least 3): %.1f\n",
                (median("vtkDICOMImageReader") - median("python-vtk-start")) / median("ctsplat")
        if ("dcm2niix" in n)
            printf "faster than dcm2niix (at least 3): %.1f\n", median("dcm2niix") / median("ctsplat")
    }'
