# --max-error: kept, or a warning; the picture is the one of the sheets that were found.
json='{"name": "hard", "points": [{"hu": 150, "rgb": [1, 0.8, 0.5], "opacity": 0}, {"hu": 160, "rgb": [1, 0.8, 0.5], "opacity": 0.98}, {"hu": 600, "rgb": [0.2, 0.3, 1], "opacity": 0.98}], "remove_table": false}'
echo "$json" >hard.json
# A given frame: what 64 sheets leave over hangs on where the pixels lie.
frame="--size 150x150 --mm-per-pixel 1.5"
for engine in tiled combined; do
    rm -f log
    ok render "$data/phantom" -p hard.json --view 30,15 $frame --engine $engine --max-error 0.5 --verify 22500 \
        -o $engine.png --log log
    [ ! -s err ] || ! grep warning err || fail "0.5/255 is within reach"
    has log '"code":"max_error"'
    grep '"event":"error"' log | grep -o '"rmse":[0-9.e-]*' | awk -F: '{ exit !($2 * 255 <= 0.5) }' || fail "the error of $engine exceeds the requested one"
done
sheets=$(sed -n 's/.*max-error` 0.5: the error of \([0-9]*\) sheets.*/\1/p' log)
[ -n "$sheets" ] || fail "a hard preset needs more sheets than one"
ok render "$data/phantom" -p hard.json --view 30,15 $frame --engine combined --samples "$sheets" -o same.png
ok compare combined.png same.png
ok render "$data/phantom" -p hard.json --view 30,15 --size 50x50 --engine classic --max-error 1e-6 -o miss.png
has err 'warning: --max-error 1e-06 is not met: the error of 64 sheets a layer is'
ok render "$data/phantom" -p hard.json --size 20x20 --engine raycast --max-error 0.001 -o exact.png
[ ! -s err ] || fail "raycast needs no trial"

# Lit, along an axis and not, where the picture has bands.
for view in anterior 140,-25; do
    rm -f log
    ok render "$data/phantom" -p bone --view $view --size 400x420 --max-error 0.2 --verify 20000 -o lit.png --log log --force
    grep '"event":"error"' log | grep -o '"rmse":[0-9.e-]*' | awk -F: '{ exit !($2 * 255 <= 0.2) }' || fail "$view, shaded: expected an error of at most 0.2/255, the log has more"
    has log '"event":"bound"'
done

# In a preview some pixels are interpolated, and the log counts them; by default none are.
last="pixels between"
ok render "$data/phantom" -p skin --engine tiled --size 400x400 --max-error 8 --verify 20000 -o between.png --log between.log
grep -Eq '[0-9]{4,} of 160000 pixels were not marched but interpolated, to within about 12/255' between.log || fail "nothing is left out"
grep '"event":"error"' between.log | grep -o '"rmse":[0-9.e-]*' | awk -F: '{ exit !($2 * 255 <= 8) }' || fail "preview: expected an error of at most 8/255, the log has more"
ok render "$data/phantom" -p skin --size 100x100 -o whole.png --log whole.log
! grep 'but interpolated, to within' whole.log || fail "pixels are left out at the default"
