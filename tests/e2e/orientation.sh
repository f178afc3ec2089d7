# Face forward, not mirrored, nothing inside out.
cat >teeth.json <<'JSON'
{ "name": "teeth", "shade": null, "remove_table": false,
  "points": [ {"hu": 300, "rgb": [1, 0, 0], "opacity": 0}, {"hu": 300, "rgb": [1, 0, 0], "opacity": 0.1},
              {"hu": 1500, "rgb": [1, 0, 0], "opacity": 0.1}, {"hu": 1500, "rgb": [0, 1, 0], "opacity": 1},
              {"hu": 2100, "rgb": [0, 1, 0], "opacity": 1}, {"hu": 2100, "rgb": [1, 0, 0], "opacity": 0.1} ] }
JSON
for engine in $engines; do
    for view in anterior posterior left head; do
        ok render "$data/phantom" -p teeth.json --view $view --engine "$engine" --size 160x140 \
            --mm-per-pixel 2 --force -o $view.png
    done
    py orientation.py anterior.png posterior.png left.png head.png
done
