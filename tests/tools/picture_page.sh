#!/bin/sh
# Pictures to look at: every series below a folder with twelve presets from four sides, small and cheap, by one program or
# by two, one below the other: picture_page.sh DIR FOLDER CTSPLAT [CTSPLAT] writes DIR/index.html, a contact sheet a
# series. ImageMagick's montage, where there is one, makes a PNG of each sheet as well.
set -eu

[ $# -ge 3 ] || { echo "usage: $0 DIR FOLDER CTSPLAT [CTSPLAT]" >&2; exit 2; }
dir=$1
folder=$2
shift 2
presets="bone skin muscle lung vessel metal ct-bone ct-muscle soft lung-window bone-window brain"
views="anterior left posterior feet"

comma() { echo "$1" | tr ' ' ','; }

mkdir -p "$dir"
n=0
for ctsplat in "$@"; do
    n=$((n + 1))
    # Series without a volume are refused, which makes the batch's exit status 8.
    "$ctsplat" batch "$folder" --presets "$(comma "$presets")" --views "$(comma "$views")" --size 256x256 \
        --max-error 8 --output-dir "$dir/$n" || [ $? -eq 8 ]
done

sheet() # SERIES: rows are views, columns presets
{
    echo "<table>"
    for view in $views; do
        echo "<tr>"
        for preset in $presets; do
            echo "<td><img src=\"$1/$preset-$view.png\" title=\"$preset, $view\" width=\"128\">"
        done
    done
    echo "</table>"
}

{
    echo "<!doctype html><meta charset=\"utf-8\"><title>Pictures</title>"
    echo "<style>body, td { background: #224; color: #ccd; padding: 1px }</style>"
    for series in "$dir"/1/*/; do
        series=${series#"$dir"/1/}
        echo "<h2>${series%/}</h2>"
        for i in $(seq $n); do
            sheet "$i/${series%/}"
        done
    done
} > "$dir/index.html"

for series in "$dir"/[12]/*/; do
    command -v montage > /dev/null || break
    (
        cd "$series"
        for view in $views; do
            for preset in $presets; do
                echo "$preset-$view.png"
            done
        done | xargs sh -c 'montage "$@" -tile 12x -geometry 256x256+1+1 -background "#224" ../"$(basename "$PWD")".png' -
    )
done
echo "$dir/index.html"
