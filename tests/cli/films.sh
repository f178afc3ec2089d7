# Films by ffmpeg: what they hold, and what is left where ffmpeg is missing, killed or out of room: nothing.
turn="render $data/phantom --rotation 5 --size 33x21 --frame-rate 7"
mkdir none fake
ln -s "$(command -v grep)" "$(command -v head)" "$(command -v sed)" none
all=$PATH
for film in a.mp4 a.GIF; do
    PATH=$work/none
    refused 5 "$film: .*ffmpeg, which is not in PATH \(package ffmpeg\)" $turn -o $film
    PATH=$work/fake:$all
    for ending in 'kill -9 $$' 'exit 1'; do
        printf '#!/bin/sh\nhead -c 3000 >/dev/null\n%s\n' "$ending" >fake/ffmpeg
        chmod +x fake/ffmpeg
        refused 5 "$film: ffmpeg: ended unexpectedly" $turn -o $film
    done
    printf '#!/bin/sh\necho "Unknown encoder '"'libx264'"'" >&2\nexit 1\n' >fake/ffmpeg
    refused 5 "$film: ffmpeg: Unknown encoder .libx264. .take one that has it" $turn -o $film
done
PATH=$all
refused 2 'a.avi: the ending names no format .*\.mp4 or \.gif' $turn -o a.avi
ls -A | grep -E '^\.|tmp|mp4|GIF' && fail 'a file is left'

command -v ffmpeg >/dev/null && command -v ffprobe >/dev/null || exit 77
ok $turn -o a.mp4 -o a.gif -o a.png
ok $turn -o b.mp4 -o b.gif --threads 1
cmp a.mp4 b.mp4 && cmp a.gif b.gif || fail 'the same film has other bytes'
streams()
{
    ffprobe -v error -count_frames -show_entries stream=codec_name,width,height,pix_fmt,r_frame_rate,nb_read_frames -of csv=p=0 "$1"
}
[ "$(streams a.mp4)" = h264,32,20,yuv420p,7/1,5 ] || fail "a.mp4: $(streams a.mp4)"
streams a.gif | grep -q '^gif,33,21,bgra,.*,5$' || fail "a.gif: $(streams a.gif)"
[ "$(ffprobe -v error -show_entries format_tags -of csv=p=0 a.mp4 | grep -c 'ctsplat .*not for diagnostic use')" = 1 ] || fail 'no comment'
# The index comes first, so that a film plays while it is loaded.
[ "$(grep -abo moov a.mp4 | head -1 | cut -d: -f1)" -lt "$(grep -abo mdat a.mp4 | head -1 | cut -d: -f1)" ] || fail 'no fast start'
# The film's colours are the pictures'.
for film in 'a.gif 33:21' 'a.mp4 32:20'; do
    set -- $film
    ffmpeg -v info -i "$1" -i a-000.png -lavfi "[0]trim=end_frame=1,format=rgb24[a];[1]crop=$2:0:0,format=rgb24[b];[a][b]psnr" \
        -f null - 2>psnr </dev/null
    decibels=$(sed -n 's/.*average:\([0-9]*\).*/\1/p' psnr)
    [ "${decibels:-0}" -ge 28 ] || fail "$1: $(tail -1 psnr)"
done
# A full disk, and a file of the same name, which stays until the new one is whole.
cp a.mp4 c.mp4
(ulimit -f 4; "$ctsplat" render "$data/phantom" --rotation 9 --size 301x301 --quality 100 -o c.mp4 --force >out 2>err) && fail 'a film without room'
has err 'error: c\.mp4: ffmpeg: .*File too large'
cmp a.mp4 c.mp4 || fail 'c.mp4 has changed'
ls -A | grep -E '^\.[^c]|tmp' && fail 'a temporary file is left'
exit 0
