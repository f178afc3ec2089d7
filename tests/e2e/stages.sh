# The timing log of every engine: its stages add up to the whole.
for engine in $engines; do
    ok render "$data/phantom" --engine "$engine" --view 20,10 --size 500x400 --shade on \
        --log log.jsonl -o out.png -o out.exr -o out.dcm --force
    py stages.py log.jsonl "$engine" 0 out.png out.exr out.dcm
    rm log.jsonl
done
ok render "$data/phantom" --size 100x80 --verify 50 --log log.jsonl -o out.png --force
py stages.py log.jsonl tiled 50 out.png
