# --show, --hide, --label and related options: pictures, refusals, pictures that a batch renders again, references in
# captures.
labels=$root/testdata/fuzz/labels
see="$data/phantom --labels $labels/binary --size 64x64 -p muscle --view 30,20"
ok render "$data/phantom" --size 64x64 -p muscle --view 30,20 -o plain.png
ok render $see -o counted.png
cmp plain.png counted.png || fail "the picture differs with --labels alone, without appearance or selection"
ok render $see --show all,rest -o all.png
cmp plain.png all.png || fail "labels that are all shown change the picture"
for asked in '--hide all' '--show 1' '--label-colours' '--label all=#ff0000 --label 2=skin'; do
    ok render $see $asked -o asked.png
    ! cmp -s plain.png asked.png || fail "$asked changes nothing"
    ok render $see $asked --threads 3 -o again.png
    cmp asked.png again.png || fail "$asked: threads change the picture"
    ok render $see $asked --engine raycast -o cast.png
    run compare asked.png cast.png
    awk '/rmse/ {seen = 1; exit !($2 < 0.002)} END {exit !seen}' out || fail "$asked: engines differ: $(cat out)"
    rm asked.png again.png cast.png
done
# Fractions have edges of their own.
part="$data/phantom --labels $labels/fractional --size 64x64 -p muscle --view 30,20 --hide 2"
ok render $part -o part.png
! cmp -s plain.png part.png || fail "a fractional label is not hidden"
ok render $part --engine raycast -o cast.png
run compare part.png cast.png
awk '/rmse/ {seen = 1; exit !($2 < 0.002)} END {exit !seen}' out || fail "fractions: engines differ: $(cat out)"
rm part.png cast.png
for mode in mip minip average; do
    ok render $see --hide all --mode $mode -o mode.png
    ok render $see --hide all --mode $mode --engine raycast -o cast.png
    run compare mode.png cast.png
    awk '/rmse/ {seen = 1; exit !($2 < 1e-4)} END {exit !seen}' out || fail "mode $mode: engines differ: $(cat out)"
    rm mode.png cast.png
done
ok render $see --hide all --engine void -o void.png
ok render $see --label-colours --size 256x256 -o unnamed.png
ok render $see --label-colours --size 256x256 --annotate labels -o named.png
! cmp -s unnamed.png named.png || fail "no names are drawn"
ok render $see --hide 1 --annotate labels -o none.png
has err 'no label has a colour of its own'

# An appearance file is equivalent to options, and options take precedence.
cat >own.json <<'END'
{"name": "own", "points": [{"hu": 0, "rgb": [1, 1, 0], "opacity": 0}, {"hu": 900, "rgb": [1, 1, 1], "opacity": 1}]}
END
printf '{"show": ["1", "rest"], "label": {"1": "#ff0000:0.2", "rest": %s}}' "$(cat own.json)" >look.json
ok render $see --show 1,rest --label 1=#ff0000:0.2 --label rest=own.json -o options.png
ok render $see --look look.json -o look.png
cmp options.png look.png || fail "a look file makes another picture than its options"
ok render $see --show all,rest --label 1=#00ff00 --label rest=own.json -o options.png --force
ok render $see --look look.json --show all,rest --label 1=#00ff00 -o look.png --force
cmp options.png look.png || fail "options beside a look file do not win"
ok render $see --look look.json -o look.png --write-state look.dcm --force
ok render "$data/phantom" --state look.dcm --labels "$labels/binary" -o state.png
cmp look.png state.png || fail "the picture of a state differs from that of its appearance file"
rm options.png look.png state.png look.dcm
while read -r text why; do
    echo "$text" | tr '~' '\n' >bad.json
    refused 2 "bad.json: line $why" render $see --look bad.json -o x.png
done <<'END'
{"show":~"1"} 2: show is not
{"show":["1",""]} 1: "" is not a name
{"shown":["1"]} 1: unknown key "shown"
{"label":~{"":"bone"}} 2: "" names no label
{"label":{"1":~{"name":"x"}}} 2: preset: line 1: points is missing
{"label_colours":1} 1: label_colours is
[] 1: the file is not an object
END
refused 2 'no-such.json: .*No such file' render $see --look no-such.json -o x.png

refused 2 'did you mean part' render $see --show 'part 3x' -o x.png
refused 2 'no label has this name' render $see --show 'part 3x,*nothing*' -o x.png
ok render $see --show 1 -o one.png
ok render $see --show '*nothing*,1' -o some.png
has err 'warning: --show: no label is called \*nothing\*; the others are shown'
cmp one.png some.png || fail "names that no label has change the picture"
refused 2 'there are no labels' render "$data/phantom" --hide 1 -o x.png
refused 2 'not a preset' render $see --label '1=#12345' -o x.png
refused 2 'engines tiled and raycast alone' render $see --label '1=#123456' --engine void -o x.png
refused 2 'mode mip shows HU' render $see --label '1=#123456' --mode mip -o x.png
refused 2 'label files 1 and 2 both have it' render $see --labels "$labels/first" --hide 1 -o x.png
ok render $see --labels "$labels/first" --hide 2:1 -o second.png

# A state contains the visibility of labels, but no paths.
ok render $see --show 1 -o shown.png --write-state state.dcm
! grep -aq "$labels" state.dcm || fail "a state contains the path of a label file"
has err 'has no information for other programs on which labels are hidden: they are no segments of a BINARY'
ok render $see --label-colours -o shown.png --write-state state.dcm --force
has err 'has no information for other programs on the appearance of labels'
ok render $see --show 1 -o shown.png --write-state state.dcm --force
ok render "$data/phantom" --state state.dcm --labels "$labels/binary" -o state.png
cmp shown.png state.png || fail "a state with its labels makes another picture"
refused 2 'there are no labels' render "$data/phantom" --state state.dcm -o x.png

cp "$labels/binary" mask
echo '{"1": "one"}' >names.json
named="$data/phantom -O named --labels mask --label-names names.json --size 32x32 --formats png"
echo '{"label": {"1": "own.json"}}' >look.json
ok batch $named --look look.json
ok batch $named --look look.json
has err '1 of them in earlier runs'
for change in 'touch -d 2001-02-03 mask' 'sed -i s/one/two/ names.json' 'sed -i s/900/800/ own.json' \
    'sed -i s/own.json/bone/ look.json'; do
    $change
    ok batch $named --look look.json
    ! grep -q 'before' err || fail "a batch does not see $change"
done

# Only of the same study, only visible ones, and not without a named segment.
segmentation=1.2.840.10008.5.1.4.1.1.66.4
shared=$root/../shared/data/labels/liver
[ -d "$shared" ] || exit 77
liver="$shared --labels $shared/liver.dcm --size 32x32 -p muscle --occlusion 0 --view head"
ok render $liver --show liver -o seen.dcm
grep -aq $segmentation seen.dcm || fail "a capture does not refer to the segmentation that it shows"
# Air around the patient is cropped with labels, too.
ok render $shared --size 400x400 -p skin -o plain.png --force
ok render $shared --labels $shared/liver.dcm --size 400x400 -p skin -o counted.png --force
cmp plain.png counted.png || fail "the picture differs with --labels alone where air around the patient is cropped"
for asked in '' '--show liver --deidentify'; do
    ok render $liver $asked --force -o unseen.dcm
    ! grep -aq $segmentation unseen.dcm || fail "render $asked: refers to a segmentation"
done
# Hidden labels are encoded for other programs as whole segments.
while read -r way asked; do
    ok render $liver $asked --force -o seen.png --write-state state.dcm
    ! grep -v 'the noise of soft tissue' err || fail "render $asked: a warning although the state expresses everything: $(cat err)"
    for word in INCLUDE_SEG EXCLUDE_SEG BOUNDING_BOX; do
        case $way in *$word*) grep -aq $word state.dcm ;; *) ! grep -aq $word state.dcm ;; esac ||
            fail "render $asked: $word"
    done
    grep -aq $segmentation state.dcm || [ "$way" = none ] || fail "render $asked: no segmentation"
done <<'LIST'
INCLUDE_SEG --show liver
EXCLUDE_SEG --hide liver
BOUNDING_BOX,INCLUDE_SEG --hide rest --crop -200,180,-200,180,-200,200
none --show all,rest
LIST
