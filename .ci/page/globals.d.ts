/* What the page itself declares: the module that is emitted for it, its forces and the points of its joints, all by
   kincompile/view/page_scripts.py; a gallery the scripts of each dimension, by gallery.py. */
declare const emitted: any;
declare const forces: any;
declare const transmitted: any;
declare const geometry: any;
declare const worlds: any;
/* By kincompile/emitters/javascript/kernels.py, of the editor. */
declare const kernels: any;
