# compare: figures, exit codes, any pairing of formats.
ok render "$data/phantom" --size 60x50 -p skin -o a.png -o a.exr -o a.dcm
ok render "$data/phantom" --size 60x50 -p skin --view -30,20 -o b.png
ok render "$data/phantom" --size 61x50 -p skin -o wide.png
ok compare a.png a.png
ok compare a.exr a.exr
ok compare a.dcm a.dcm
has out 'equal to the bit'
ok compare a.png a.png --json
has out '"rmse": 0\.0'
has out '"psnr_db": 999'
has out '"ssim": 1\.0'

# different A B: exit 1, with figures and no error
different()
{
    run compare "$@"
    [ "$code" = 1 ] || fail "exit code $code, expected 1"
    [ -s out ] && [ ! -s err ] || fail "figures go to standard output, and nothing is wrong"
}

different a.png b.png
has out 'not equal'
different a.png a.exr --json
has out '"share": 0\.0'
for key in rmse psnr_db ssim p999 max share; do
    has out "\"$key\": [0-9.e-]+,?\$"
done
# 8 bits of 16: at most half a step apart.
different a.png a.dcm --json
has out '"max": 0\.00(1[0-9]*|0[0-9]*),'
different a.dcm a.exr

refused 2 'a.png, wide.png: .*60x50 and 61x50' compare a.png wide.png
refused 3 'nowhere.png' compare a.png nowhere.png
echo hello >text.png
refused 3 'text.png' compare text.png a.png
for lossy in jpg webp; do
    ok render "$data/phantom" --size 60x50 -p skin -o "a.$lossy"
    refused 3 "a.$lossy: .*that is read \(\.png, \.exr or \.dcm\)" compare a.png "a.$lossy"
done
head -c 300 a.png >cut.png
refused 3 'cut.png' compare a.png cut.png
refused 3 'IM0001' compare a.dcm "$data/phantom/IM0001.dcm"
