#!/bin/bash
# The completions offer the options of --help: completion.sh SOURCE_ROOT CTSPLAT. In bash, the offers for each option
# and its argument are compared; in zsh, if installed, the specifications.
set -u
root=$(realpath "$1") ctsplat=$(realpath "$2")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
mkdir bin folder
touch picture.png own.json folder/x
ln -s "$ctsplat" bin/ctsplat
export PATH=$work/bin:$PATH HOME=$work XDG_CONFIG_HOME=$work/config
for name in ctsplat.bash _ctsplat; do
    sed "s#@DATADIR@#$root/src/app/deploy/completion#" "$root/src/app/deploy/completion/$name" >$name
done
bad=0
fail()
{
    echo "FAIL: $*"
    bad=1
}
. ./ctsplat.bash

# offers WORD...: what bash offers for the last of these words, one a line
offers()
{
    COMP_WORDS=(ctsplat "$@") COMP_CWORD=$#
    _ctsplat
    printf '%s\n' "${COMPREPLY[@]}"
}
# expect OFFERED WORD...: each word is among what is offered for the words in $typed
expect()
{
    local word all
    offers "${typed[@]}" >offered
    all=$'\n'$(<offered)$'\n'
    for word; do
        [[ $all == *$'\n'"$word"$'\n'* ]] || fail "bash does not offer $word for: ctsplat ${typed[*]}"
    done
}

commands=$(ctsplat --help | awk '/^Commands:/ { on = 1; next } /^$/ { on = 0 } on && /^  [a-z]/ { print $1 }')
[ "$(echo "$commands" | wc -l)" -ge 6 ] || fail "--help lists no commands"
typed=('')
expect $commands --help --version
for command in $commands; do
    ctsplat "$command" --help all >help
    grep -oE '^  (-., |    )--[a-z-]+' help | grep -oE -e '-(-[a-z-]+|.,)' | tr -d , >options
    grep -qx -e --help options || fail "$command --help lists no options"
    typed=("$command" -)
    expect $(cat options)
    # Values of an option with several words are listed in its help; none may be missing.
    grep -oE -e '--[a-z-]+ [a-z0-9, -]+ or [a-z0-9-]+' help | sed 's/,//g; s/ or / /' >choices
    while read -r option words; do
        typed=("$command" "$option" '')
        expect $words
    done <choices
done

typed=(render --engine '')
expect classic layers void combined tiled raycast
typed=(render --engine t)
expect tiled
[ "$(wc -l <offered)" = 1 ] || fail "bash offers more than tiled for --engine t"
typed=(render --engine = ra)
expect raycast
typed=(render --view '')
expect anterior posterior left right head feet
typed=(render -p '')
expect bone skin ct-bone own.json
grep -q picture.png offered && fail "bash offers a picture for a preset"
typed=(render folder -o pic)
expect picture.png
typed=(bench -O '')
expect folder
grep -q picture.png offered && fail "bash offers a file for a folder"
typed=(compare '')
expect picture.png folder
typed=(presets sk)
expect skin
if ctsplat batch --help all >help 2>&1; then
    typed=(batch --preset bone,sk)
    expect bone,skin
    typed=(batch --format '')
    expect png exr dcm
fi

if command -v zsh >/dev/null; then
    for command in $commands; do
        ctsplat "$command" --help all | grep -oE '^  (-., |    )--[a-z-]+' | grep -oE -e '-(-[a-z-]+|.,)' | tr -d , |
            sort >options
        zsh -f -c '
            _arguments() { print -rl -- "$@" }
            compadd() { }
            words=(ctsplat $1 x) CURRENT=3
            source ./_ctsplat' zsh "$command" >specs 2>zsh.err || fail "zsh: $(cat zsh.err)"
        [ ! -s zsh.err ] || fail "zsh: $(cat zsh.err)"
        sed -nE 's/^\*?(-[a-zA-Z]|--[a-z-]+)[=+]?\[.*/\1/p' specs | sort >known
        diff options known >difference || fail "zsh, ctsplat $command: $(cat difference)"
    done
else
    echo "zsh is missing: only bash was tested"
fi
exit $bad
