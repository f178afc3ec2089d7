# One head, stored in many ways, gives one picture; any number of threads gives the same bytes.
render()
{
    ok render "$@" --size 80x60 --shade on --force
}

render "$data/syntax/explicit" -o first.png
for syntax in implicit big deflated rle jpeg-lossless jpeg-ls; do
    render "$data/syntax/$syntax" -o "$syntax.png"
    cmp first.png "$syntax.png" || fail "syntax $syntax changes the picture"
done
for pixels in unsigned-12 unsigned-high unsigned-12-jpeg-ls unsigned-12-jpeg-lossless; do
    render "$data/pixels/$pixels" -o "$pixels.png"
    cmp first.png "$pixels.png" || fail "pixels $pixels changes the picture"
done
render "$data/pixels/signed-12-junk" -o junk.png
render "$data/pixels/signed-12-rle" -o rle.png
cmp junk.png rle.png || fail "unused bits change the picture"
py tolerance.py 0.01 first.png junk.png
for pixels in fractional-slope odd-slope slope-per-slice; do
    render "$data/pixels/$pixels" -o "$pixels.png"
    py tolerance.py 0.01 first.png "$pixels.png"
done

# The same voxels in another order: the same scene, the same layers, up to the order of sums.
for geometry in coronal sagittal feet-first far-origin; do
    render "$data/geometry/$geometry" --engine raycast -o "$geometry.png"
    render "$data/syntax/explicit" --engine raycast -o ray.png
    py tolerance.py 0.0001 ray.png "$geometry.png"
done

for engine in $engines; do
    for threads in 1 2 7; do
        ok render "$data/phantom" --engine "$engine" --view 30,20 --size 90x70 --threads $threads \
            -o "threads-$threads.png" -o "threads-$threads.exr" --force
    done
    for ending in png exr; do
        cmp threads-1.$ending threads-2.$ending || fail "$engine: 2 threads change the $ending"
        cmp threads-1.$ending threads-7.$ending || fail "$engine: 7 threads change the $ending"
    done
    cp threads-1.png again.png
    ok render "$data/phantom" --engine "$engine" --view 30,20 --size 90x70 -o threads-1.png --force
    cmp again.png threads-1.png || fail "$engine: a second run changes the picture"
done
