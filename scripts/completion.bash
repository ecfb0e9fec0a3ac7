# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
#
# Completion for bash of `rosrun view_servo view ...`: commands, options, names of views. Source it; setup.bash of the workspace
# does so in interactive shells. What else rosrun is given is completed as before, by rosbash.
# shellcheck shell=bash

# Prints the names of the stored views, one a line; nothing when that is not known at once. $@: remappings.
_view_servo_names()
{
  local prefix prefixes
  IFS=: read -ra prefixes <<< "${CMAKE_PREFIX_PATH:-}"
  for prefix in "${prefixes[@]}"; do
    if [[ -x $prefix/lib/view_servo/view ]]; then
      timeout 3 "$prefix/lib/view_servo/view" list --names --patience 1 "$@" 2> /dev/null < /dev/null
      return
    fi
  done
}

# Completes what follows `view`. $1: the index of that word in COMP_WORDS.
_view_servo_view()
{
  local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]}
  local command=${COMP_WORDS[$1 + 1]:-} options="--help --patience" index word count=0 remappings=()
  COMPREPLY=()
  if ((COMP_CWORD == $1 + 1)); then
    mapfile -t COMPREPLY < <(compgen -W "list save show delete go record follow stop watch --help" -- "$current")
    return
  fi
  case $command in
    list) options+=" --json --names" ;;
    save) options+=" --overwrite --learn --roi --file" ;;
    show) options+=" --out" ;;
    go) options+=" --timeout --enable --wait --driver --approach" ;;
    follow) options+=" --timeout --enable --wait --from --to --reverse" ;;
    stop) options+=" --all" ;;
    record | delete | watch) ;;
    *) return ;;
  esac
  # Bash takes a:=b apart into three words.
  for ((index = $1 + 2; index < ${#COMP_WORDS[@]}; ++index)); do
    word=${COMP_WORDS[index]}
    case $word in
      := | *:=*) remappings+=("${COMP_WORDS[index - 1]}:=${COMP_WORDS[index + 1]:-}") ;;
    esac
  done
  case $previous in
    --file | --out)
      compopt -o filenames 2> /dev/null  # fails when this is called by hand, which does no harm
      mapfile -t COMPREPLY < <(compgen -f -- "$current")
      return
      ;;
    --driver)
      mapfile -t COMPREPLY < <(compgen -W "homing servo_25d route_follower" -- "$current")
      return
      ;;
    --from | --to)
      mapfile -t COMPREPLY < <(compgen -W "$(_view_servo_names "${remappings[@]}")" -- "$current")
      return
      ;;
    --timeout | --patience | --roi | --approach) return ;;
  esac
  if [[ $current == -* ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$options" -- "$current")
    return
  fi
  # A view's name is the first word that is neither an option nor what belongs to one.
  for ((index = $1 + 2; index < COMP_CWORD; ++index)); do
    case ${COMP_WORDS[index]} in
      --file | --out | --driver | --timeout | --patience) index=$((index + 1)) ;;
      --roi) index=$((index + 4)) ;;
      --approach) index=$((index + 2)) ;;
      -*) ;;
      *) [[ ${COMP_WORDS[index + 1]:-} == := || ${COMP_WORDS[index]} == := || ${COMP_WORDS[index - 1]} == := ]] || count=1 ;;
    esac
  done
  [[ $command != go ]] || count=0  # of several
  # An existing view is saved to replace it.
  if ((count == 0 && index == COMP_CWORD)) && [[ $command =~ ^(show|delete|go)$ ||
      $command == save && " ${COMP_WORDS[*]} " == *" --overwrite "* ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$(_view_servo_names "${remappings[@]}")" -- "$current")
  fi
}

_view_servo_rosrun()
{
  local index=1
  while ((index < COMP_CWORD)); do  # options of rosrun
    case ${COMP_WORDS[index]} in
      --prefix) index=$((index + 2)) ;;
      --debug) index=$((index + 1)) ;;
      *) break ;;
    esac
  done
  if ((COMP_CWORD > index + 1)) && [[ ${COMP_WORDS[index]} == view_servo && ${COMP_WORDS[index + 1]} == view ]]; then
    _view_servo_view $((index + 1))
  elif [[ -n $_view_servo_before ]]; then
    "$_view_servo_before" "$@"
  fi
}

# Puts this before what completes rosrun so far.
_view_servo_install()
{
  local specification file
  local form='^complete (.*)-F ([^ ]+) (.*)rosrun$'
  if ! complete -p rosrun &> /dev/null; then  # rosbash is loaded when it is first needed, or not at all
    for file in "/opt/ros/${ROS_DISTRO:-}/share/rosbash/rosbash" /usr/share/rosbash/rosbash \
        /usr/share/bash-completion/completions/rosbash; do
      if [[ -r $file ]]; then
        # shellcheck disable=SC1090
        source "$file"
        break
      fi
    done
  fi
  specification=$(complete -p rosrun 2> /dev/null)
  if [[ ! $specification =~ $form ]]; then
    _view_servo_before=
    complete -o default -F _view_servo_rosrun rosrun
  elif [[ ${BASH_REMATCH[2]} != _view_servo_rosrun ]]; then
    _view_servo_before=${BASH_REMATCH[2]}
    # shellcheck disable=SC2086
    complete ${BASH_REMATCH[1]} -F _view_servo_rosrun ${BASH_REMATCH[3]} rosrun
  fi
}

_view_servo_install
unset -f _view_servo_install
