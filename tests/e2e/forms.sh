# The pixel format of each file: grey, colour or alpha by preset, mode and background, and the same picture in all of
# them.
cat >greys.json <<'JSON'
{ "name": "greys", "shade": { "ambient": 0.2, "diffuse": 0.8, "specular": 0.3, "power": 20 },
  "points": [ { "hu": 0, "rgb": [0, 0, 0], "opacity": 0 }, { "hu": 500, "rgb": [0.7, 0.7, 0.7], "opacity": 0.5 } ] }
JSON

# form FORM BACKGROUND OPTION...: renders all three formats, to be checked at the end
captures=
n=0
form()
{
    form=$1 background=$2
    shift 2
    n=$((n + 1))
    ok render "$data/phantom" --size 40x30 --background "$background" "$@" -o $n.png -o $n.exr -o $n.dcm
    captures="$captures $form $background $n.png $n.dcm"
    run compare $n.png $n.exr
    [ "$code" -le 1 ] || fail "the .exr cannot be read"
    has out '^share +0 of'
}

for background in '#000000' '#808080' none; do
    form colour "$background" -p bone
    form grey "$background" -p ./greys.json
    form grey "$background" -p bone --mode mip
done
form grey none -p bone --mode minip
form grey '#000000' -p bone --mode average
form colour '#ff8000' -p bone
form colour '#ff8000' -p ./greys.json
form colour '#ff8000' -p bone --mode mip
for engine in $engines; do
    form grey none -p ./greys.json --engine "$engine"
    form colour '#102030' -p skin --engine "$engine" --opacity-unit voxel
done

# Every frame has the form of the first, also one that shows nothing.
ok render "$data/phantom" --size 24x18 -p bone --rotation 3 --crop 0,3,0,3,0,4 -o turn.png -o turn.dcm
captures="$captures colour #000000 turn-002.png turn.dcm"

# Sizes and scales at their ends.
for size in 1x1 16384x1 1x2000; do
    for mode in composite mip; do
        ok render "$data/phantom" --size $size --mode $mode --annotate orientation,scale -o a.png -o a.exr -o a.dcm \
            --force
        py size.py a.png "${size%x*}" "${size#*x}" dark
    done
done
ok render "$data/phantom" --size 40x30 --mm-per-pixel 0.0001 --annotate scale -o a.png -o a.exr -o a.dcm --force
form colour '#ff8000' -p bone --mm-per-pixel 1000

# A single voxel is a box without inside.
form colour '#ff8000' -p bone --crop 0,3,0,3,0,4
form grey '#000000' -p bone --mode mip --crop 0,3,0,3,0,4
refused 2 'crop box holds no voxel' render "$data/phantom" --crop 5000,5001,0,1,0,1 -o none.png
refused 2 'crop' render "$data/phantom" --crop 1,0,0,1,0,1 -o none.png
[ ! -e none.png ] || fail "a refused crop wrote a picture"
# shellcheck disable=SC2086 # a list of words
py forms.py $captures
