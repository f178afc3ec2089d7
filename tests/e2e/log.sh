# The timing log: whole, adds up, and holds no patient data.
for engine in $engines; do
    expect 0 "$ctsplat" render "$data/phantom" --engine "$engine" --view 20,10 --size 500x400 --shade on \
        --log log.jsonl -o out.png -o out.exr --force
    py log.py log.jsonl "$engine" 0 out.png out.exr || fail "engine $engine"
    rm log.jsonl
done
expect 0 "$ctsplat" render "$data/phantom" --size 100x80 --verify 50 --log log.jsonl -o out.png --force
py log.py log.jsonl tiled 50 out.png
rm log.jsonl

# Two runs append; - is stderr; the log of a refused run ends, too.
expect 0 "$ctsplat" render "$data/phantom" --size 32x32 --log log.jsonl -o out.png --force
expect 0 "$ctsplat" render "$data/phantom" --size 32x32 --log log.jsonl -o out.png --force
[ "$(grep -c '"event":"done"' log.jsonl)" -eq 2 ] || fail "two runs do not append to one log"
expect 0 "$ctsplat" render "$data/phantom" --size 32x32 --log - -o out.png --force
says stderr '"event":"done"'
[ ! -s stdout ] || fail "the log went to stdout"
