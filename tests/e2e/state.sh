# A presentation state beside the picture makes it again, byte for byte; options beside it win; pydicom and the standard's
# tables agree with it.
SOURCE_DATE_EPOCH=1000000000 && export SOURCE_DATE_EPOCH
cat >mine.json <<'JSON'
{ "name": "mine", "points": [ {"hu": -200.1, "rgb": [0.1, 0.2, 0.3], "opacity": 0},
  {"hu": 33.333333333333336, "rgb": [1, 0.7000000000000001, 0.3], "opacity": 0.123456789012345678},
  {"hu": 900, "rgb": [1, 1, 1], "opacity": 1} ], "unit_distance_mm": 0.7,
  "shade": {"ambient": 0.1, "diffuse": 0.7, "specular": 1.5, "power": 30}, "background": "#102030" }
JSON
n=0
while read -r options; do
    n=$((n + 1))
    # shellcheck disable=SC2086
    ok render "$data/phantom" --size 61x47 $options -o a.png -o a.dcm --write-state "state-$n.dcm" --force
    ok render "$data/phantom" --state "state-$n.dcm" -o b.png -o b.dcm --write-state again.dcm --force
    cmp a.png b.png || fail "another picture with --state: $options"
    cmp a.dcm b.dcm || fail "another object with --state: $options"
    cmp "state-$n.dcm" again.dcm || fail "another state from --state: $options"
    cp a.dcm "picture-$n.dcm"
done <<'LIST'
--view -30,20 --preset skin
--preset mine.json --view 12.3456789,-7.000001
--mode mip --view left
--mode average --view head
--preset ct-muscle --crop -60,60.5,-200,200,-200,200 --shade off --remove-table off
--engine raycast --kernel bspline --background none --mm-per-pixel 2.7182818284590451 --annotate orientation
--engine classic --grey-bits 8 --opacity-unit voxel --max-error 2
LIST
# Options given beside a state take precedence over it.
ok render "$data/phantom" --size 61x47 --preset skin --view left -o c.png
ok render "$data/phantom" --state state-1.dcm --view left -o d.png
cmp c.png d.png || fail "--view beside --state does not win"
ok render "$data/phantom" --size 61x47 --view -30,20 --preset bone -o c.png --force
ok render "$data/phantom" --preset bone --state state-1.dcm -o d.png --force
cmp c.png d.png || fail "--preset beside --state does not win"

# The state chooses its own series; another one is refused, or rendered with a warning where it is requested.
for series in 1 2; do
    ok render "$root/testdata/series/two" --series $series --size 20x20 -o own.png --write-state own.dcm --force
    ok render "$root/testdata/series/two" --state own.dcm -o chosen.png --force
    cmp own.png chosen.png || fail "--state does not choose series $series"
done
refused 4 'volume that the presentation state lists is not among the 1 found' render "$data/phantom" --state own.dcm -o e.png
ok render "$data/phantom" --series 1 --state own.dcm -o other.png
has err 'warning: --state: the presentation state lists another volume'

refused 3 'no Volume Rendering' render "$data/phantom" --state a.dcm -o e.png
refused 3 'no DICOM' render "$data/phantom" --state a.png -o e.png
refused 3 'none\.dcm' render "$data/phantom" --state none.dcm -o e.png
refused 2 'deidentify' render "$data/phantom" --deidentify --write-state e.dcm -o e2.dcm
refused 5 'force' render "$data/phantom" --write-state state-1.dcm -o e.png
refused 2 'state-1' render "$data/phantom" --write-state state-1.dcm -o state-1.dcm --force
# Cut anywhere, it is refused, or is still whole in what is read of it.
size=$(wc -c <state-1.dcm)
for part in 100 200 1000 5000 20000 35000 $((size - 300)) $((size - 1)); do
    head -c "$part" state-1.dcm >cut.dcm
    refused 3 'cut\.dcm' render "$data/phantom" --state cut.dcm -o e.png
done
[ ! -e e.png ] || fail "a refused state leaves a picture"
py state.py
