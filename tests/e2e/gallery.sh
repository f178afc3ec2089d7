# The gallery page: the options below each picture make that picture, and its names and files agree.
page=$root/man/gallery.md
grep -o '(gallery-[a-z]*\.png)' "$page" | tr -d '()' >names
grep -o '`--preset [^`]*`' "$page" | tr -d '`' >options
[ -s names ] && [ "$(wc -l <names)" = "$(wc -l <options)" ] || fail "pictures without options, or options without pictures"
[ "$(ls "$root"/man/gallery-*.png | wc -l)" = "$(wc -l <names)" ] || fail "a picture of man/ is not on the page"
while read -r name <&3 && read -r line <&4; do
    eval "ok render \"$data/phantom\" --size 200x176 --mm-per-pixel 1.25 $line -o picture.dcm --force"
    run compare "$root/man/$name" picture.dcm
    [ "$code" -le 1 ] || fail "$name cannot be compared"
    awk '$1 == "rmse" { near = $2 < 0.002 } END { exit !near }' out || fail "$name is not what $line makes: $(cat out)"
done 3<names 4<options
