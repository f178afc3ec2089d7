# bash completion for ctsplat. Options come from `ctsplat COMMAND --help`, so that they are those of the program.

# _ctsplat_offer WORD...: adds what fits to COMPREPLY; of a list with commas the last one is completed
_ctsplat_offer()
{
    local word head='' words=''
    for word; do
        case $word in
        @files) mapfile -t -O ${#COMPREPLY[@]} COMPREPLY < <(compgen -f -- "$current") && compopt -o filenames ;;
        @json)
            mapfile -t -O ${#COMPREPLY[@]} COMPREPLY < <(compgen -f -X '!*.json' -- "$current" && compopt -o filenames)
            mapfile -t -O ${#COMPREPLY[@]} COMPREPLY < <(compgen -d -S / -- "$current" && compopt -o nospace)
            ;;
        @folders) mapfile -t -O ${#COMPREPLY[@]} COMPREPLY < <(compgen -d -- "$current") && compopt -o filenames ;;
        @presets) words+=" $(ctsplat presets 2>/dev/null | awk 'NR > 1 { print $1 }')" ;;
        @nothing | @list) ;;
        *) words+=" $word" ;;
        esac
    done
    [[ $current != *,* ]] || head=${current%,*},
    mapfile -t -O ${#COMPREPLY[@]} COMPREPLY < <(compgen -P "$head" -W "$words" -- "${current##*,}")
} 2>/dev/null

_ctsplat()
{
    local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]} command=${COMP_WORDS[1]}
    local options names kind help words=()
    COMPREPLY=()
    if [ "$COMP_CWORD" = 1 ]; then
        _ctsplat_offer --help --version \
            $(ctsplat --help 2>/dev/null | awk '/^Commands:/ { on = 1; next } /^$/ { on = 0 } on && /^  [a-z]/ { print $1 }')
        return
    fi
    # --option=value comes as three words.
    if [ "$current" = = ]; then
        current=
    elif [ "$previous" = = ]; then
        previous=${COMP_WORDS[COMP_CWORD - 2]}
    fi
    options=$(ctsplat "$command" --help all 2>/dev/null | awk -f @DATADIR@/options.awk)
    while IFS=$'\t' read -r names kind _; do
        if [[ ,$names, == *,$previous,* && -n $kind ]]; then
            _ctsplat_offer $kind
            return
        fi
        words+=(${names//,/ })
    done < <(printf '%s\n' "$options" | sed 's/\t\t/\t \t/')
    if [[ $current == -* ]]; then
        _ctsplat_offer "${words[@]}"
    else
        _ctsplat_offer $([ "$command" = presets ] && echo @presets @json || echo @files)
    fi
}
complete -F _ctsplat ctsplat
