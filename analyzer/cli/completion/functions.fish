# What completes the kinds of values. The names stand in _tailbyte_names_KIND.

function _tailbyte_one_type; string split ' ' -- $_tailbyte_names_types; end
function _tailbyte_one_rule; string split ' ' -- $_tailbyte_names_rules; end
function _tailbyte_types; __fish_complete_list , _tailbyte_one_type; end
function _tailbyte_rules; __fish_complete_list , _tailbyte_one_rule; end
function _tailbyte_fields; string split ' ' -- $_tailbyte_names_fields; end
function _tailbyte_terms; string split ' ' -- $_tailbyte_names_terms; end
function _tailbyte_lexicon; string split ' ' -- $_tailbyte_names_lexicon; end
function _tailbyte_tables; string split ' ' -- $_tailbyte_names_tables; end
function _tailbyte_topics; string split ' ' -- $_tailbyte_names_topics; end
function _tailbyte_origins; string split ' ' -- $_tailbyte_names_origins; end
function _tailbyte_flights; string split ' ' -- $_tailbyte_names_flights; end
function _tailbyte_scenarios; string split ' ' -- $_tailbyte_names_scenarios; end
function _tailbyte_drivers; string split ' ' -- $_tailbyte_names_drivers; end
function _tailbyte_one_gate; string split ' ' -- $_tailbyte_names_gates; end
function _tailbyte_one_difference; string split ' ' -- $_tailbyte_names_differences; end
function _tailbyte_gates; __fish_complete_list , _tailbyte_one_gate; end
function _tailbyte_differences; __fish_complete_list , _tailbyte_one_difference; end

# A statistic, and names behind the commas where it takes them.
function _tailbyte_statistics
    if string match -qr '^(values,|io,[^,]*,)' -- (commandline -ct)
        _tailbyte_filters
    else
        string split ' ' -- $_tailbyte_names_statistics
    end
end

# The last name of a filter, which stands between quotes more often than not, or a value of it.
function _tailbyte_filters
    set -l word (string replace -r '^[\'"]' '' -- (commandline -ct))
    set -l compared '^(.*?)([A-Za-z_][A-Za-z0-9_.]*)( *(?:[=!]==?| eq| ne| in *\{(?:[^}]*,)?) *)("?)([^]="!{},&|()]*)$'
    set -l parts (string match -r $compared -- $word)
    if test (count $parts) -ge 4
        set -l found (string split ' ' -- $_tailbyte_names_values | string match -- "$parts[3]=*")
        if test (count $found) -gt 0
            printf '%s\n' "$parts[2]$parts[3]$parts[4]\""(string replace -r '^[^=]*=' '' -- $found | string replace -a '~' ' ')'"'
            return
        end
    end
    set -l before (string replace -r '^[\'"]' '' -- (commandline -ct) | string replace -r '[A-Za-z0-9_.]*$' '')
    printf '%s\n' "$before"(string split ' ' -- $_tailbyte_names_terms)
end

# Captures by their names before any other files.
function _tailbyte_file_captures
    __fish_complete_suffix (string split ' ' -- $_tailbyte_names_suffixes | string replace -r '^' '.')
end

function _tailbyte_interfaces
    for one in /sys/class/net/*
        test -r $one/type; and test (cat $one/type) = 280; and basename $one
    end
end

function _tailbyte_file_sources
    _tailbyte_interfaces
    _tailbyte_file_captures
end
