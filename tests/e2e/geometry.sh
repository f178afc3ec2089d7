# --size, --mm-per-pixel and --crop place the phantom where ctsplat(1), PICTURES, puts it.
cat >window.json <<'JSON'
{ "name": "window", "window": [0, 2000], "mode": "mip", "remove_table": false,
  "points": [ {"hu": 0, "rgb": [1, 1, 1], "opacity": 0}, {"hu": 2000, "rgb": [1, 1, 1], "opacity": 1} ] }
JSON
for size in 160x140 161x141; do
    ok render "$data/phantom" -p window.json --engine raycast --size $size --mm-per-pixel 2 -o mip-$size.png
    ok render "$data/phantom" -p window.json --engine raycast --size $size --mm-per-pixel 2 --crop 60,200,-200,0,40,200 \
        -o crop-$size.png
done
ok render "$data/phantom" -p window.json --engine raycast --size 320x280 --mm-per-pixel 1 -o fine.png
ok render "$data/phantom" -p window.json --engine raycast --size 200x100 --fit volume -o fit.png
py geometry.py
