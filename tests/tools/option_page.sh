#!/bin/sh
# Pictures side by side to choose an option's value by eye: every series below a folder, a row for each preset and view, a
# column for each set of options: option_page.sh DIR FOLDER CTSPLAT OPTIONS [OPTIONS ...], e.g.
#     option_page.sh out/occlusion ../shared/data build/src/cli/ctsplat "--occlusion 0" "--occlusion 0.3" "--occlusion 0.6"
# writes DIR/index.html and, by ImageMagick's montage where there is one, DIR/SERIES.png. PRESETS, VIEWS (lists with commas)
# and SIZE (WxH) in the environment choose others.
set -eu

[ $# -ge 4 ] || { echo "usage: $0 DIR FOLDER CTSPLAT OPTIONS [OPTIONS ...]" >&2; exit 2; }
dir=$1
folder=$2
ctsplat=$3
shift 3
presets=${PRESETS:-bone,skin,muscle,vessel}
views=${VIEWS:-anterior,left,head}
size=${SIZE:-320x320}

mkdir -p "$dir"
n=0
for options in "$@"; do
    n=$((n + 1))
    # Word splitting separates the options. Series without a volume are refused, which makes the batch's exit status 8.
    # shellcheck disable=SC2086
    "$ctsplat" batch "$folder" --presets "$presets" --views "$views" --size "$size" $options --output-dir "$dir/$n" ||
        [ $? -eq 8 ]
done

rows=$(for preset in $(echo "$presets" | tr , ' '); do
    for view in $(echo "$views" | tr , ' '); do
        echo "$preset-$view.png"
    done
done)

{
    echo "<!doctype html><meta charset=\"utf-8\"><title>Options side by side</title>"
    echo "<style>body, td { background: #224; color: #ccd; padding: 1px }</style>"
    for series in "$dir"/1/*/; do
        series=$(basename "$series")
        echo "<h2>$series</h2><table><tr>"
        for options in "$@"; do
            echo "<th>$options</th>"
        done
        for row in $rows; do
            echo "<tr>"
            for i in $(seq $n); do
                echo "<td><img src=\"$i/$series/$row\" title=\"${row%.png}\">"
            done
        done
        echo "</table>"
    done
} > "$dir/index.html"

for series in "$dir"/1/*/; do
    command -v montage > /dev/null || break
    series=$(basename "$series")
    for row in $rows; do
        for i in $(seq $n); do
            echo "$dir/$i/$series/$row"
        done
    done | xargs sh -c 'montage "$@" -tile "$0"x -geometry +1+1 -background "#224" png:-' "$n" > "$dir/$series.png"
done
echo "$dir/index.html"
