#!/bin/bash
# Cost of the first picture of a series: first_picture.sh CTSPLAT SOURCE_ROOT, or with BEFORE=CTSPLAT in the environment
# two builds in turn. A preview of 512 x 512 pixels of each real series with bone and skin, one thread, the run with the
# least processor time of 5: milliseconds by stage, MiB at the peak and those aimed at, twice the scanned volume and 64;
# then the time of six previews of a batch (2 presets, 3 views) relative to one.
set -euo pipefail
ctsplat=$1 data=$2/../shared/data
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
[ -d "$data" ] || { echo "skipped: no $data"; exit 0; }

# fields LOG: processor time in all and by stage, the peak, and the peak aimed at by what was decoded
fields()
{
    awk -F'[:,}]' '
        { for (i = 1; i < NF; i++) value[$i] = $(i + 1) }
        /"event":"stage"/ { cpu[value["\"stage\""]] = value["\"cpu_ms\""] }
        /"stage":"decode"/ { bytes = value["\"bytes\""] }
        /"event":"done"/ { all = value["\"cpu_ms\""]; peak = value["\"peak_rss_bytes\""] }
        END {
            printf "%.0f", all
            n = split("scan decode grey classify splat composite shade export", stage, " ")
            for (i = 1; i <= n; i++)
                printf " %.0f", cpu["\"" stage[i] "\""]
            printf " %.0f %.0f\n", peak / 1048576, 2 * bytes / 1048576 + 64
        }' "$1"
}

# least SERIES PRESET
least()
{
    local which run
    for run in 1 2 3 4 5; do
        for which in ${BEFORE:+"$BEFORE"} "$ctsplat"; do
            "$which" render "$data/$1" --preset "$2" --size 512x512 --max-error 8 --threads 1 --force \
                -o "$work/picture.jpg" --log "$work/log" 2>"$work/said"
            echo "$which $1 $2 $(fields "$work/log")"
            rm "$work/log"
        done
    done | sort -n -k4 | awk '!seen[$1]++' | sed "s|^${BEFORE:-none} |before |; s|^$ctsplat |now |"
}

# processor_ms COMMAND...
processor_ms()
{
    local TIMEFORMAT='%U %S'
    { time "$@" >"$work/said" 2>&1; } 2>&1 | awk '{ print 1000 * ($1 + $2) }'
}

echo "build series preset cpu_ms scan decode grey classify splat composite shade export peak_mib aim_mib"
for series in chest-ge head-tilt-ge head-phantom/S2020 body-j2k; do
    [ -d "$data/$series" ] || { echo "skipped: no $data/$series"; continue; }
    for preset in bone skin; do
        least "$series" "$preset"
    done
done

for series in chest-ge head-tilt-ge head-phantom/S2020; do
    [ -d "$data/$series" ] || continue
    mkdir "$work/archive"
    cp -rL "$data/$series" "$work/archive/series"
    for run in 1 2 3; do
        for which in ${BEFORE:+"$BEFORE"} "$ctsplat"; do
            for pictures in "bone anterior" "bone,skin anterior,left,posterior"; do
                rm -rf "$work/out"
                processor_ms "$which" batch "$work/archive" --presets "${pictures% *}" --views "${pictures#* }" \
                    --size 512x512 --max-error 8 --formats jpg --threads 1 --output-dir "$work/out"
                ls "$work"/out/*/*.jpg >"$work/files" || { cat "$work/said" >&2; exit 1; }
            done | paste -sd' ' | sed "s|^|$which |; s|^${BEFORE:-none} |before |; s|^$ctsplat |now |"
        done
    done | awk -v series="$series" '
        !($1 in one) || $2 < one[$1] { one[$1] = $2 }
        !($1 in six) || $3 < six[$1] { six[$1] = $3 }
        END { for (build in one) printf "%s six previews of %s: %.2f times one\n", build, series, six[build] / one[build] }'
    rm -r "$work/archive"
done
