# Options that `ctsplat COMMAND --help` lists, for the completions: one line an option, with tabs between
function kind(name, argument, help)
{
    if (name == "--preset")
        return list "@presets @json"
    if (name == "--view")
        return list "anterior posterior left right head feet"
    if (name == "--annotate")
        return "@list orientation scale labels captions"
    if (name == "--format" && match(help, /^[a-z0-9]+( [a-z0-9]+)*:/))
        return list substr(help, 1, RLENGTH - 1)
    if (argument ~ /FILE/)
        return "@files"
    if (argument ~ /DIR|PATH/)
        return "@folders"
    if (argument ~ /^NAME/ && match(help, /^[a-z]+( [a-z-]+)*[;,]/))
        return substr(help, 1, RLENGTH - 1)
    if (argument ~ / or / && argument !~ /[A-Z]/) {
        gsub(/,| or /, " ", argument)
        gsub(/  +/, " ", argument)
        return argument
    }
    return argument == "" ? "" : "@nothing"
}

function put()
{
    if (names != "")
        print names "\t" kind(name, argument, help) "\t" help
    names = ""
}

/^Usage: ctsplat batch / { list = "@list " }

/^  (-[a-zA-Z], |    )--/ {
    put()
    match($0, /--[a-z-]+/)
    names = name = substr($0, RSTART, RLENGTH)
    if ($0 ~ /^  -[a-zA-Z],/)
        names = substr($0, 3, 2) "," name
    rest = substr($0, index($0, name) + length(name))
    # The help begins after two blanks, or on the next line.
    at = match(rest, /  +/)
    argument = at ? substr(rest, 1, at - 1) : rest
    help = at ? substr(rest, at) : ""
    sub(/^ /, "", argument)
    sub(/^ +/, "", help)
    next
}

names != "" {
    sub(/^ +/, "")
    help = help (help == "" ? "" : " ") $0
}

END { put() }
